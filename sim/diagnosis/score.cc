#include "sim/diagnosis/score.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/diagnosis/neighbour_sum.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeverageMax = 0.5;  // of a signature in one row: an outlier looks the same
constexpr double kKeptMin = 0.01;     // of a unit's signature beside its geometry
constexpr double kDependent = 1e-7;   // of a column's length: the rest is rounding

// Orthonormal columns, by modified Gram-Schmidt done twice; dependent ones are left out.
class Basis {
 public:
  explicit Basis(Index rows) : columns_(rows, 0) {}
  void Add(VectorXd column) {
    const double before = column.norm();
    if (!(before > 0)) return;
    Remove(&column);
    Remove(&column);
    const double after = column.norm();
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
  [[nodiscard]] Index size() const { return columns_.cols(); }

 private:
  MatrixXd columns_;
};

class UnitScorer {
 public:
  UnitScorer(const Fit& fit, std::size_t unit, std::size_t without)
      : fit_(fit),
        unit_(unit),
        without_(without),
        white_(Whiten(fit, unit)),
        basis_(white_.y.size()) {
    y_ = white_.y;
    target_ = VectorXd::Zero(y_.size());
    shared_.resize(y_.size(), 0);
    for (Index c = 0; c < white_.geometry.cols(); ++c) basis_.Add(white_.geometry.col(c));
    AddTerms();
    AddHomings();
    basis_.Remove(&y_);
    basis_.Remove(&target_);
    basis_.Remove(&shared_);
  }

  [[nodiscard]] bool usable() const { return y_.size() > basis_.size() + 3; }
  [[nodiscard]] const VectorXd& y() const { return y_; }
  [[nodiscard]] const VectorXd& target() const { return target_; }
  [[nodiscard]] const MatrixXd& shared() const { return shared_; }
  [[nodiscard]] const WhiteUnit& white() const { return white_; }

  /// The template's projected columns; `raw` gets their squared length before.
  MatrixXd Signature(const Template& form, double* raw) {
    MatrixXd m(y_.size(), static_cast<Index>(form.columns));
    for (std::size_t c = 0; c < form.columns; ++c) {
      ApplyColumn(white_.track, form, c, 1, &errors_);
      WhiteDisplacement(white_, errors_, m.col(static_cast<Index>(c)).data());
    }
    *raw = m.squaredNorm();
    basis_.Remove(&m);
    return m;
  }
  [[nodiscard]] Index freedom_spent() const { return basis_.size(); }

 private:
  void AddTerms() {
    for (std::size_t t = 0; t < fit_.model.terms.size(); ++t) {
      const ModelTerm& term = fit_.model.terms[t];
      const std::span<const double> amplitude = term.AmplitudeOf(unit_);
      if (t == without_) {
        if (amplitude.empty()) continue;
        errors_.Reset(white_.track.moves);
        term.form.effect->apply(white_.track, term.form, amplitude, &errors_);
        WhiteDisplacement(white_, errors_, target_.data());
        y_ += target_;
        continue;
      }
      VectorXd column = VectorXd::Zero(y_.size());
      for (std::size_t c = 0; c < term.form.columns; ++c) {
        if (!amplitude.empty()) {
          const bool plain = term.sharing == Sharing::kFleet || term.sharing == Sharing::kUnit;
          ApplyColumn(white_.track, term.form, c, plain ? 1 : amplitude[c], &errors_);
          WhiteDisplacement(white_, errors_, column.data());
        }
        if (term.sharing == Sharing::kUnit) {
          basis_.Add(column);
        } else {
          shared_.conservativeResize(Eigen::NoChange, shared_.cols() + 1);
          shared_.col(shared_.cols() - 1) = column;
        }
      }
    }
  }

  void AddHomings() {
    VectorXd column(y_.size());
    for (const Homing& homing : FreeHomingsOf(fit_.model, white_.track)) {
      ApplyHoming(white_.track, homing, &errors_);
      WhiteDisplacement(white_, errors_, column.data());
      basis_.Add(column);
    }
  }

  const Fit& fit_;
  std::size_t unit_;
  std::size_t without_;
  WhiteUnit white_;
  Basis basis_;
  VectorXd y_, target_;
  MatrixXd shared_;
  PoseErrors errors_;
};

// What a chunk of units adds to the sums over the fleet.
struct FleetPart {
  std::vector<double> exposure_b, exposure_g;
  VectorXd shared_b;  // of one template: shared' m, per column
  double raw = 0, kept = 0, spread_sum = 0, spread_count = 0;
};

struct ChunkPart {
  std::vector<FleetPart> of_template;
  std::vector<MatrixXd> shared_cross;  // shared' M, per template
  MatrixXd shared_g;
  VectorXd shared_b, shared_target_b;
  double target_square = 0, residual_square = 0;
  std::size_t values = 0;
};

void AddRows(const MatrixXd& m, const VectorXd& y, const WhiteUnit& white,
             const Exposures& exposures, FleetPart* part) {
  const auto c = static_cast<std::size_t>(m.cols());
  if (c == 1) {  // most templates
    const double* a = m.data();
    for (std::size_t k = 0; k < white.moves.size(); ++k, a += 2) {
      const std::size_t e = exposures.of_row[white.track.first_row + white.moves[k]];
      const auto at = static_cast<Index>(2 * k);
      part->exposure_b[e] += a[0] * y[at] + a[1] * y[at + 1];
      part->exposure_g[e] += a[0] * a[0] + a[1] * a[1];
    }
    return;
  }
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t e = exposures.of_row[white.track.first_row + white.moves[k]];
    const auto at = static_cast<Index>(2 * k);
    for (std::size_t p = 0; p < c; ++p) {
      const auto ip = static_cast<Index>(p);
      part->exposure_b[e * c + p] += m(at, ip) * y[at] + m(at + 1, ip) * y[at + 1];
      for (std::size_t q = 0; q < c; ++q) {
        const auto iq = static_cast<Index>(q);
        part->exposure_g[(e * c + p) * c + q] +=
            m(at, ip) * m(at, iq) + m(at + 1, ip) * m(at + 1, iq);
      }
    }
  }
}

template <int kSize>
double SpreadOf(const MatrixXd& m, const VectorXd& y) {
  using Sum = NeighbourSum<kSize>;
  const Index c = m.cols();
  const typename Sum::Square g = m.transpose() * m;
  const typename Sum::Square inverse = g.ldlt().solve(Sum::Square::Identity(c, c));
  const typename Sum::Small own = inverse * (m.transpose() * y);
  Sum sum(inverse);
  typename Sum::Small row(c);
  for (Index at = 0; at + 1 < y.size(); at += 2) {
    row = m.row(at).transpose() * (y[at] - m.row(at).dot(own)) +
          m.row(at + 1).transpose() * (y[at + 1] - m.row(at + 1).dot(own));
    sum.Add(row);
  }
  return sum.sum();
}

// Dispersion of the moves' scores about the unit's own fit, 1 for noise as modelled. Noise that
// remembers makes more of it.
void AddSpread(const MatrixXd& m, const VectorXd& y, Index spent, FleetPart* part) {
  const Index c = m.cols();
  const double sum = c == 1 ? SpreadOf<1>(m, y) : SpreadOf<Eigen::Dynamic>(m, y);
  const double n = static_cast<double>(y.size());
  const double free = n - static_cast<double>(spent + c);
  if (free < 4 || !std::isfinite(sum)) return;
  part->spread_sum += sum * n / free;
  part->spread_count += static_cast<double>(c);
}

// Share of a signature that one row has.
double Leverage(const MatrixXd& m, double kept) {
  double most = 0;
  for (Index at = 0; at + 1 < m.rows(); at += 2)
    most = std::max(most, m.row(at).squaredNorm() + m.row(at + 1).squaredNorm());
  return most / kept;
}

void ScoreUnit(const Fit& fit, const Templates& templates, std::size_t unit, std::size_t without,
               ScorePass* pass, ChunkPart* part) {
  UnitScorer scorer(fit, unit, without);
  if (!scorer.usable()) return;
  part->residual_square += scorer.y().squaredNorm();
  part->target_square += scorer.target().squaredNorm();
  part->values += static_cast<std::size_t>(scorer.y().size());
  const MatrixXd& shared = scorer.shared();
  part->shared_g.noalias() += shared.transpose() * shared;
  part->shared_b.noalias() += shared.transpose() * scorer.y();
  part->shared_target_b.noalias() += shared.transpose() * scorer.target();
  for (std::size_t k = 0; k < templates.size(); ++k) {
    double raw = 0;
    const MatrixXd m = scorer.Signature(templates[k], &raw);
    FleetPart& fleet = part->of_template[k];
    fleet.raw += raw;
    const double kept = m.squaredNorm();
    // Less than this is what the unit's geometry explains as well, and large amplitudes of it.
    if (!(kept > kKeptMin * raw)) continue;
    if (templates[k].columns == 1 && Leverage(m, kept) > kLeverageMax) continue;
    fleet.kept += kept;
    const auto c = static_cast<Index>(templates[k].columns);
    const MatrixXd g = m.transpose() * m;
    const VectorXd b = m.transpose() * scorer.y();
    const VectorXd target_b = m.transpose() * scorer.target();
    Score& score = pass->scores[k];
    const auto at = static_cast<Index>(unit) * c;
    std::copy_n(b.data(), c, score.b.begin() + at);
    std::copy_n(target_b.data(), c, score.target_b.begin() + at);
    std::copy_n(g.data(), c * c, score.g.begin() + at * c);
    AddRows(m, scorer.y(), scorer.white(), fit.facts->exposures, &fleet);
    AddSpread(m, scorer.y(), scorer.freedom_spent(), &fleet);
    part->shared_cross[k].noalias() += shared.transpose() * m;
  }
}

Index SharedColumns(const Fit& fit, std::size_t without) {
  Index columns = 0;
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t)
    if (t != without && fit.model.terms[t].sharing != Sharing::kUnit)
      columns += static_cast<Index>(fit.model.terms[t].form.columns);
  return columns;
}

ChunkPart EmptyPart(const Fit& fit, const Templates& templates, Index shared) {
  const std::size_t exposures = fit.facts->exposures.size();
  ChunkPart part;
  part.of_template.resize(templates.size());
  part.shared_cross.resize(templates.size());
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const std::size_t c = templates[k].columns;
    part.of_template[k].exposure_b.assign(exposures * c, 0);
    part.of_template[k].exposure_g.assign(exposures * c * c, 0);
    part.shared_cross[k] = MatrixXd::Zero(shared, static_cast<Index>(c));
  }
  part.shared_g = MatrixXd::Zero(shared, shared);
  part.shared_b = VectorXd::Zero(shared);
  part.shared_target_b = VectorXd::Zero(shared);
  return part;
}

void AddTo(const std::vector<double>& from, std::vector<double>* to) {
  for (std::size_t i = 0; i < from.size(); ++i) (*to)[i] += from[i];
}

void Merge(const ChunkPart& from, ChunkPart* to) {
  for (std::size_t k = 0; k < from.of_template.size(); ++k) {
    const FleetPart& a = from.of_template[k];
    FleetPart& b = to->of_template[k];
    AddTo(a.exposure_b, &b.exposure_b);
    AddTo(a.exposure_g, &b.exposure_g);
    b.raw += a.raw, b.kept += a.kept;
    b.spread_sum += a.spread_sum, b.spread_count += a.spread_count;
    to->shared_cross[k] += from.shared_cross[k];
  }
  to->shared_g += from.shared_g;
  to->shared_b += from.shared_b;
  to->shared_target_b += from.shared_target_b;
  to->target_square += from.target_square;
  to->residual_square += from.residual_square;
  to->values += from.values;
}

void TakeFleet(const ChunkPart& all, const Templates& templates, ScorePass* pass) {
  const Index shared = all.shared_g.rows();
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(
      shared > 0 ? all.shared_g : MatrixXd::Identity(1, 1));
  for (std::size_t k = 0; k < templates.size(); ++k) {
    Score& score = pass->scores[k];
    const FleetPart& part = all.of_template[k];
    const auto c = static_cast<Index>(templates[k].columns);
    score.exposure_b = part.exposure_b;
    score.exposure_g = part.exposure_g;
    score.raw = part.raw, score.kept = part.kept;
    score.spread_sum = part.spread_sum, score.spread_count = part.spread_count;
    score.fleet_b = VectorXd::Zero(c);
    score.fleet_target_b = VectorXd::Zero(c);
    score.fleet_g = MatrixXd::Zero(c, c);
    const auto units = static_cast<Index>(score.b.size()) / c;
    for (Index u = 0; u < units; ++u) {
      score.fleet_b += Eigen::Map<const VectorXd>(&score.b[static_cast<std::size_t>(u * c)], c);
      score.fleet_target_b +=
          Eigen::Map<const VectorXd>(&score.target_b[static_cast<std::size_t>(u * c)], c);
      score.fleet_g +=
          Eigen::Map<const MatrixXd>(&score.g[static_cast<std::size_t>(u * c * c)], c, c);
    }
    if (shared == 0) continue;
    const double own = score.fleet_g.trace();
    const MatrixXd gone = solver.solve(all.shared_cross[k]);
    score.fleet_b -= gone.transpose() * all.shared_b;
    score.fleet_target_b -= gone.transpose() * all.shared_target_b;
    score.fleet_g -= all.shared_cross[k].transpose() * gone;
    // What the model has already says nothing new: what is left of it is rounding.
    if (score.fleet_g.trace() > kKeptMin * own) continue;
    score.fleet_b.setZero();
    score.fleet_target_b.setZero();
    score.fleet_g.setZero();
  }
}

}  // namespace

bool IsImpossible(const Template& form, const VectorXd& b, const MatrixXd& g) {
  constexpr double kSigmas = 3;
  if (!(g.trace() > 0)) return false;
  if (b.size() == 1) return !CanBe(form, b[0] / g(0, 0), kSigmas / std::sqrt(g(0, 0)));
  const double size = std::sqrt(std::max(b.dot(g.ldlt().solve(b)) / g.trace(), 0.0) *
                                static_cast<double>(b.size()));
  return size > RangeOfAmplitude(*form.effect).high +
                    kSigmas * std::sqrt(static_cast<double>(b.size()) / g.trace());
}

ScorePass ScoreTemplates(const Fit& fit, const Templates& templates, std::size_t without) {
  const std::size_t units = fit.model.units.size();
  ScorePass pass;
  pass.scores.resize(templates.size());
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const std::size_t c = templates[k].columns;
    pass.scores[k].b.assign(units * c, 0);
    pass.scores[k].target_b.assign(units * c, 0);
    pass.scores[k].g.assign(units * c * c, 0);
  }
  const Index shared = SharedColumns(fit, without);
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  std::vector<ChunkPart> parts(chunks.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    parts[chunk] = EmptyPart(fit, templates, shared);
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      ScoreUnit(fit, templates, unit, without, &pass, &parts[chunk]);
  });
  ChunkPart all = EmptyPart(fit, templates, shared);
  for (const ChunkPart& part : parts) Merge(part, &all);
  pass.target_square = all.target_square;
  pass.residual_square = all.residual_square;
  pass.values = all.values;
  TakeFleet(all, templates, &pass);
  return pass;
}

}  // namespace focalfleet::sim
