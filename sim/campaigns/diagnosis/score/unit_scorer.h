// A unit in a pass over all templates has its whitened rows, the span of its own unknowns, and the
// residuals in each look. A look leaves one term of the model out, or none. Templates' columns are
// in lanes, eight side by side.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/lanes.h"
#include "sim/campaigns/diagnosis/score/score.h"

namespace focalfleet::sim {

/// Orthonormal columns, by modified Gram-Schmidt done twice; dependent ones are left out.
class Basis {
 public:
  explicit Basis(Eigen::Index rows) : columns_(rows, 0) {}
  void Add(Eigen::VectorXd column) {
    const double before = column.norm();
    if (!(before > 0)) return;
    Remove(&column);
    Remove(&column);
    const double after = column.norm();
    constexpr double kDependent = 1e-7;  // of the column's length: the rest is rounding
    if (after < kDependent * before) return;
    columns_.conservativeResize(Eigen::NoChange, columns_.cols() + 1);
    columns_.col(columns_.cols() - 1) = column / after;
  }
  template <class Columns>
  void Remove(Columns* columns) const {
    if (columns_.cols() == 0) return;
    const auto parts = (columns_.transpose() * *columns).eval();
    columns->noalias() -= columns_ * parts;
  }
  [[nodiscard]] Eigen::Index size() const { return columns_.cols(); }
  [[nodiscard]] const Eigen::MatrixXd& columns() const { return columns_; }

 private:
  Eigen::MatrixXd columns_;
};

/// The lanes of the templates' columns: whole templates, those of one column first.
struct Placed {
  std::size_t form = 0;
  std::size_t lane = 0;
};
struct Block {
  std::vector<Placed> forms;
  bool single = true;  // all of one column
};

std::vector<Block> PlaceInLanes(const Templates& templates);

/// The shared columns of terms and of their distortions that are fitted beside the templates in a
/// look without one term.
struct SharedColumns {
  std::vector<Eigen::Index> begin_of_term;  // kNone: its amplitudes are units' own
  std::vector<Eigen::Index> begin_of_discrepancy;
  Eigen::Index begin_of_frames = 0;
  std::vector<double> precision, value;  // of a column's prior, and its amplitude; 0: none
  Eigen::Index count = 0;
  std::vector<std::vector<Eigen::Index>> of_look;
  static constexpr Eigen::Index kNone = -1;
};

SharedColumns ListShared(const CampaignModel& model, std::span<const std::size_t> withouts);

/// A unit in each of the looks. Looks differ in which term is left out; the rows and their
/// whitening are the same.
class UnitScorer {
 public:
  /// The span of the unit's own unknowns, and the shared columns beside it. The span of an unknown
  /// with a prior is removed in part: the root of its marginal covariance takes 1 - 1/sqrt(1 + s^2
  /// l^2) of a direction of length l.
  struct Plane {
    Basis basis;                // all directions, the whole ones first
    std::vector<double> parts;  // of each direction that is removed. Shape: (directions)
    double spent = 0;           // degrees of freedom
    Eigen::MatrixXd shared;
    template <class Columns>
    void Remove(Columns* columns) const {
      if (basis.size() == 0) return;
      auto along = (basis.columns().transpose() * *columns).eval();
      for (Eigen::Index k = 0; k < along.rows(); ++k)
        along.row(k) *= parts[static_cast<std::size_t>(k)];
      columns->noalias() -= basis.columns() * along;
    }
  };
  struct UnitLook {
    std::size_t plane = 0;
    Eigen::VectorXd y, target;
    bool usable = false;
  };

  UnitScorer(const Fit& fit, std::size_t unit, std::span<const std::size_t> withouts,
             const SharedColumns& shared);

  [[nodiscard]] const WhiteUnit& white() const { return white_; }
  [[nodiscard]] const std::vector<Plane>& planes() const { return planes_; }
  [[nodiscard]] const std::vector<UnitLook>& looks() const { return looks_; }
  [[nodiscard]] bool usable() const;

  /// Makes the templates' whitened columns.
  void MakeSignatures(const Templates& templates, const Block& block, std::vector<Lanes>* rows);

 private:
  void MakeColumns(std::size_t t, Eigen::Index shared_begin);
  void MakeDistorted(const SharedColumns& shared);
  [[nodiscard]] bool HasOwnDistorted(std::size_t term) const {
    return term < distorted_.size() && distorted_[term].cols() > 0 &&
           !fit_.model.discrepancies[term].own.empty();
  }
  void MakeHomings();
  void MakeFrames(Eigen::Index begin);
  [[nodiscard]] Plane PlaneWithout(std::size_t without) const;
  void AddDistorted(std::size_t without, Plane* plane) const;
  void AddBackDistorted(std::size_t without, Eigen::VectorXd* y) const;
  UnitLook LookWithout(std::size_t without, std::size_t plane);

  const Fit& fit_;
  std::size_t unit_;
  WhiteUnit white_;
  std::vector<Eigen::MatrixXd> own_;        // Shape: (terms): columns of units' own amplitudes
  std::vector<Eigen::MatrixXd> distorted_;  // Shape: (terms): columns of distortions
  Eigen::MatrixXd shared_, homings_;
  std::vector<Plane> planes_;
  std::vector<UnitLook> looks_;
  PoseErrors errors_;
};

}  // namespace focalfleet::sim
