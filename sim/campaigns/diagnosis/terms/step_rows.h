// A unit's whitened residuals beside its geometry, and the score of steps in them. A step is a
// fixed error of an axis from one move to the next homing. The geometry of a unit is bent by the
// steps that are not found yet. A step is therefore scored by the rows near it, with the geometry
// free in these rows alone.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/score/unit_scorer.h"

namespace focalfleet::sim {

class StepRows {
 public:
  StepRows(const Fit& fit, std::size_t unit);

  [[nodiscard]] const UnitTrack& track() const { return white_.track; }
  [[nodiscard]] std::size_t rows() const { return white_.moves.size(); }
  [[nodiscard]] std::size_t move(std::size_t row) const { return white_.moves[row]; }
  /// The residuals, whitened, that no pose of the unit explains.
  [[nodiscard]] const Eigen::VectorXd& left() const { return y_; }

  /// The trace of a step by one degree in `move`, until the next homing, beside the geometry.
  [[nodiscard]] Eigen::VectorXd Column(std::size_t axis, std::size_t move, bool stays) const;
  /// The step is known: it is taken from the rows.
  void Take(const Eigen::VectorXd& column, double step_deg);

  /// The score of steps by one degree, and their products. Shape: (axes), (axes, axes).
  struct Jump {
    std::array<double, 2> b{};
    std::array<std::array<double, 2>, 2> g{};
  };
  /// Steps before a row, by at most `either_side` rows on each side. Zero where no step can have a
  /// log likelihood ratio above `least`.
  [[nodiscard]] Jump JumpAt(std::size_t row, std::size_t either_side, double least) const;

  /// The first move in which a step that this row shows may have been: after the row before, and
  /// not before a homing or the closing of a loop that has undone it.
  [[nodiscard]] std::size_t MoveAfterRow(std::size_t row) const;
  /// The first row from this one on that would show a turn of the axis, above its noise, within the
  /// same history. Folded arms do not show where theta stands.
  [[nodiscard]] std::size_t RowThatShows(std::size_t axis, std::size_t row) const;

 private:
  // Columns of a row, side by side: the geometry's, and the residual.
  static constexpr Eigen::Index kGeometryColumns = 6, kStepColumns = kGeometryColumns + 1;
  using StepProducts = Eigen::Matrix<double, kStepColumns, kStepColumns>;

  [[nodiscard]] Eigen::VectorXd Behind(std::size_t axis, std::size_t row, std::size_t end) const;
  void AddUp();

  WhiteUnit white_;
  Basis geometry_;
  Eigen::VectorXd y_;
  std::vector<StepProducts> sums_;  // of all rows before each. Shape: (rows + 1)
};

/// The probability from which a step is taken, where others like it are known: as that of a name.
/// Half and double of its odds change no name of three campaigns of another author, and two of 80
/// steps.
inline constexpr double kSureOfStep = 0.9;

/// Steps of a unit that are looked for in one look.
inline constexpr std::size_t kStepsOfUnitMax = 40;

/// Costs of explanations, in ln of a likelihood, differ by more than rounding. Sums of some
/// thousands of squares are exact to a thousandth of it.
inline constexpr double kCostRounding = 1e-6;

/// No move of a track.
inline constexpr std::size_t kNoMove = std::numeric_limits<std::size_t>::max();

/// Rows on either side that a step is looked for by. The narrowest that shows one has the fewest
/// other steps within it: narrowest over threshold, Baranowski et al., J. R. Stat. Soc. B 81, 649.
/// With half of these rows eight of nine slips of a unit are found, with twice as many all nine.
inline constexpr std::array<std::size_t, 3> kEitherSide = {4, 8, 16};

}  // namespace focalfleet::sim
