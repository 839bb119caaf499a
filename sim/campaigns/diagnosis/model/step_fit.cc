// The Gauss-Newton step of fit.h.
#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/discrepancy.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// An unknown without data or prior must not move.
constexpr double kNoData = 1e-12;

// The equations of one unit: its own unknowns (geometry, own amplitudes, homings), and the shared
// ones that reach it.
struct UnitEquations {
  MatrixXd own;                  // columns
  VectorXd prior, value;         // weight of the prior of each unknown, and its distance from it
  std::vector<Index> shared_at;  // indices of the shared unknowns
  MatrixXd shared;               // columns
  VectorXd y;
};

void AppendColumn(const VectorXd& column, MatrixXd* columns) {
  columns->conservativeResize(column.size(), columns->cols() + 1);
  columns->col(columns->cols() - 1) = column;
}

// Appends an unknown of the unit's own: its column, the weight of its prior, and its distance from
// it.
void AppendOwn(const VectorXd& column, double prior, double value, UnitEquations* eq) {
  AppendColumn(column, &eq->own);
  eq->prior.conservativeResize(eq->own.cols());
  eq->value.conservativeResize(eq->own.cols());
  eq->prior[eq->own.cols() - 1] = prior;
  eq->value[eq->own.cols() - 1] = value;
}

// The number of the term's amplitudes that several units have together.
Index CountShared(const ModelTerm& term) {
  if (term.sharing == Sharing::kUnit) return term.has_mean ? 1 : 0;
  return static_cast<Index>(term.amplitude.size());
}

Index CountFrameUnknowns(const CampaignModel& model) {
  return model.frames.empty() ? 0
                              : static_cast<Index>(kExposureParameters * (model.frames.size() - 1));
}

// Calls `each` with every unknown of the frames: its index, the spread of its prior, and its value.
template <class Each>
void ForFrameUnknowns(CampaignModel* model, Index begin, const Each& each) {
  for (std::size_t frame = 1; frame < model->frames.size(); ++frame)
    for (std::size_t k = 0; k < kExposureParameters; ++k)
      each(begin++, kFrameSpread[k], model->frames[frame][k]);
}

void AppendHomings(const Fit& fit, const WhiteUnit& white, UnitEquations* eq) {
  PoseErrors errors;
  VectorXd column(white.y.size());
  for (const Homing& homing : FreeHomingsOf(fit.model, white.track)) {
    ApplyHoming(white.track, homing, &errors);
    WhiteDisplacement(white, errors, column.data());
    const double spread = std::max(fit.model.homing_spread_deg[homing.axis], 1e-6);
    AppendOwn(column, 1 / (spread * spread),
              fit.model.homing_zero_deg[homing.axis][white.track.first_row + homing.begin], eq);
  }
}

// The distortions that terms bring: common to all units, and the unit's own.
void AppendDistortions(const Fit& fit, std::size_t unit, const WhiteUnit& white,
                       const std::vector<Index>& shared_begin, UnitEquations* eq) {
  MatrixXd columns;
  for (const Discrepancy& of : fit.model.discrepancies) {
    if (!of.HasUnit(unit)) continue;
    DistortionColumns(white, of, &columns);
    for (std::size_t d = 0; d < of.distortions.size(); ++d) {
      const auto column = columns.col(static_cast<Index>(d));
      if (!of.own.empty())
        AppendOwn(column, 1 / (of.spread * of.spread), of.own[unit * of.distortions.size() + d],
                  eq);
      if (d < of.first_common()) continue;
      AppendColumn(column, &eq->shared);
      eq->shared_at.push_back(shared_begin[fit.model.terms.size() + of.of] +
                              static_cast<Index>(d - of.first_common()));
    }
  }
}

// The frames that the unit was seen in, but for the first.
void AppendFrames(const Fit& fit, const WhiteUnit& white, Index begin, UnitEquations* eq) {
  PoseErrors errors;
  VectorXd column(white.y.size());
  for (std::size_t frame = 1; frame < fit.model.frames.size(); ++frame)
    for (std::size_t k = 0; k < kExposureParameters; ++k) {
      if (!ApplyFrame(white.track, frame, k, &errors)) break;
      WhiteDisplacement(white, errors, column.data());
      AppendColumn(column, &eq->shared);
      eq->shared_at.push_back(begin + static_cast<Index>(kExposureParameters * (frame - 1) + k));
    }
}

UnitEquations MakeEquations(const Fit& fit, std::size_t unit, const WhiteUnit& white,
                            const std::vector<Index>& shared_begin) {
  UnitEquations eq;
  eq.y = white.y;
  eq.own = white.geometry;
  const bool moves[2] = {TellsOfItself(white.track.cmd_deg[kTheta]),
                         TellsOfItself(white.track.cmd_deg[kPhi])};
  eq.prior = StaticPriorWeights(fit.geometry_is, moves);
  eq.value = ToVector(fit.model.units[unit]) - ToVector(fit.facts->campaign->units[unit]);
  eq.shared.resize(white.y.size(), 0);
  PoseErrors errors;
  VectorXd column(white.y.size());
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const ModelTerm& term = fit.model.terms[t];
    const std::uint32_t group = term.group_of_unit[unit];
    if (group == kNoGroup) continue;
    for (std::size_t c = 0; c < term.form.columns; ++c) {
      ApplyColumn(white.track, term.form, c, 1, &errors);
      WhiteDisplacement(white, errors, column.data());
      if (term.sharing == Sharing::kUnit)
        AppendOwn(column, term.spread > 0 ? 1 / (term.spread * term.spread) : 0,
                  term.amplitude[group * term.form.columns + c] - term.mean, &eq);
      if (CountShared(term) == 0) continue;
      AppendColumn(column, &eq.shared);
      const std::size_t of_group = term.has_mean ? 0 : group * term.form.columns + c;
      eq.shared_at.push_back(shared_begin[t] + static_cast<Index>(of_group));
    }
  }
  AppendHomings(fit, white, &eq);
  AppendDistortions(fit, unit, white, shared_begin, &eq);
  AppendFrames(fit, white, shared_begin.back(), &eq);
  return eq;
}

struct UnitSolution {
  Eigen::LDLT<MatrixXd> own;
  VectorXd right;  // of the own unknowns
  MatrixXd cross;  // own x shared
  std::vector<Index> shared_at;
  bool used = false;
};

struct SharedSystem {
  MatrixXd normal;
  VectorXd right;
};

UnitSolution Eliminate(const UnitEquations& eq, SharedSystem* shared) {
  UnitSolution solution;
  MatrixXd normal = eq.own.transpose() * eq.own;
  normal.diagonal() += eq.prior;
  normal.diagonal().array() += kNoData;
  solution.right = eq.own.transpose() * eq.y - eq.prior.cwiseProduct(eq.value);
  solution.own.compute(normal);
  solution.cross = eq.own.transpose() * eq.shared;
  solution.shared_at = eq.shared_at;
  solution.used = true;
  if (!eq.shared_at.empty()) {
    const MatrixXd gone = solution.own.solve(solution.cross);
    const MatrixXd block = eq.shared.transpose() * eq.shared - solution.cross.transpose() * gone;
    const VectorXd right = eq.shared.transpose() * eq.y - gone.transpose() * solution.right;
    for (std::size_t a = 0; a < eq.shared_at.size(); ++a) {
      const auto ia = static_cast<Index>(a);
      shared->right[eq.shared_at[a]] += right[ia];
      for (std::size_t b = 0; b < eq.shared_at.size(); ++b)
        shared->normal(eq.shared_at[a], eq.shared_at[b]) += block(ia, static_cast<Index>(b));
    }
  }
  return solution;
}

// A unit's own data may pull its amplitude beyond the possible range, where it is held. The other
// unknowns make up for the difference in the next round.
void Advance(double step, const Effect& effect, double* amplitude) {
  const auto [low, high] = RangeOfAmplitude(effect);
  *amplitude = std::clamp(*amplitude + step, low, high);
}

// `mean_step`: of each term. Shape: (terms).
void TakeOwn(const VectorXd& step, const VectorXd& sigma, const std::vector<double>& mean_step,
             std::size_t unit, Fit* fit) {
  AddStatic(step.head<6>(), &fit->model.units[unit]);
  Index at = kStaticColumns;
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t) {
    ModelTerm& term = fit->model.terms[t];
    const std::uint32_t group = term.group_of_unit[unit];
    if (term.sharing != Sharing::kUnit || group == kNoGroup) continue;
    for (std::size_t c = 0; c < term.form.columns; ++c, ++at) {
      Advance(step[at] + mean_step[t], *term.form.effect,
              &term.amplitude[group * term.form.columns + c]);
      term.sigma[group * term.form.columns + c] = sigma[at];
    }
  }
  if (!fit->model.homing_zero_deg[kTheta].empty()) {
    const UnitTrack track = MakeTrack(*fit->facts, unit, fit->model.units[unit]);
    for (const Homing& homing : FreeHomingsOf(fit->model, track)) {
      for (std::size_t i = homing.begin; i < homing.end; ++i)
        fit->model.homing_zero_deg[homing.axis][track.first_row + i] += step[at];
      ++at;
    }
  }
  for (Discrepancy& of : fit->model.discrepancies) {
    if (of.own.empty() || !of.HasUnit(unit)) continue;
    for (std::size_t d = unit * of.distortions.size(); d < (unit + 1) * of.distortions.size();
         ++d, ++at)
      of.own[d] += step[at], of.own_sigma[d] = sigma[at];
  }
}

}  // namespace

void StepFit(Fit* fit) {
  if (RenewDiscrepancies(fit)) UpdateResiduals(fit);
  const std::size_t units = fit->model.units.size();
  std::vector<Index> shared_begin;
  Index shared_count = 0;
  for (const ModelTerm& term : fit->model.terms) {
    shared_begin.push_back(shared_count);
    shared_count += CountShared(term);
  }
  for (const Discrepancy& of : fit->model.discrepancies) {
    shared_begin.push_back(shared_count);
    shared_count += static_cast<Index>(of.common.size());
  }
  shared_begin.push_back(shared_count);
  shared_count += CountFrameUnknowns(fit->model);
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  std::vector<UnitSolution> solutions(units);
  std::vector<SharedSystem> parts(chunks.size());
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    parts[chunk] = {MatrixXd::Zero(shared_count, shared_count), VectorXd::Zero(shared_count)};
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      if (!fit->UsesUnit(unit)) continue;
      const WhiteUnit white = Whiten(*fit, unit);
      if (white.moves.size() < 3) continue;
      solutions[unit] = Eliminate(MakeEquations(*fit, unit, white, shared_begin), &parts[chunk]);
    }
  });
  VectorXd shared = VectorXd::Zero(shared_count);
  VectorXd shared_sigma = VectorXd::Zero(shared_count);
  if (shared_count > 0) {
    SharedSystem all{MatrixXd::Zero(shared_count, shared_count), VectorXd::Zero(shared_count)};
    for (const SharedSystem& part : parts) all.normal += part.normal, all.right += part.right;
    all.normal.diagonal().array() += kNoData;
    for (const Discrepancy& of : fit->model.discrepancies)
      for (std::size_t d = 0; d < of.common.size(); ++d) {
        const Index at = shared_begin[fit->model.terms.size() + of.of] + static_cast<Index>(d);
        const double precision = 1 / (of.spread * of.spread);
        all.normal(at, at) += precision;
        all.right[at] -= of.common[d] * precision;
      }
    ForFrameUnknowns(&fit->model, shared_begin.back(), [&](Index at, double spread, double value) {
      const bool is_seen = all.normal(at, at) > 2 * kNoData;  // else it stays as it is
      all.normal(at, at) += 1 / (spread * spread);
      if (is_seen) all.right[at] -= value / (spread * spread);
    });
    const Eigen::LDLT<MatrixXd> solver(all.normal);
    shared = solver.solve(all.right);
    shared_sigma = solver.solve(MatrixXd::Identity(shared_count, shared_count))
                       .diagonal()
                       .cwiseMax(0)
                       .cwiseSqrt();
  }
  for (Discrepancy& of : fit->model.discrepancies)
    for (std::size_t d = 0; d < of.common.size(); ++d) {
      const Index at = shared_begin[fit->model.terms.size() + of.of] + static_cast<Index>(d);
      of.common[d] += shared[at], of.common_sigma[d] = shared_sigma[at];
    }
  ForFrameUnknowns(&fit->model, shared_begin.back(),
                   [&](Index at, double, double& value) { value += shared[at]; });
  std::vector<double> mean_step(fit->model.terms.size(), 0);
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t) {
    ModelTerm& term = fit->model.terms[t];
    if (term.has_mean) {
      mean_step[t] = shared[shared_begin[t]];
      term.mean += mean_step[t];
      term.mean_sigma = shared_sigma[shared_begin[t]];
    }
    if (term.sharing == Sharing::kUnit) continue;
    for (std::size_t k = 0; k < term.amplitude.size(); ++k) {
      Advance(shared[shared_begin[t] + static_cast<Index>(k)], *term.form.effect,
              &term.amplitude[k]);
      term.sigma[k] = shared_sigma[shared_begin[t] + static_cast<Index>(k)];
    }
  }
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const UnitSolution& solution = solutions[unit];
      if (!solution.used) continue;
      VectorXd right = solution.right;
      for (std::size_t a = 0; a < solution.shared_at.size(); ++a)
        right -= solution.cross.col(static_cast<Index>(a)) * shared[solution.shared_at[a]];
      const VectorXd step = solution.own.solve(right);
      const Index n = step.size();
      const VectorXd sigma =
          solution.own.solve(MatrixXd::Identity(n, n)).diagonal().cwiseMax(0).cwiseSqrt();
      TakeOwn(step, sigma, mean_step, unit, fit);
    }
  });
  UpdateSpreads(&fit->model);
  UpdateResiduals(fit);
}

void SettleFit(Fit* fit, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    UpdateNoise(fit);
    UpdateWeights(fit);
    StepFit(fit);
  }
  UpdateNoise(fit);
  UpdateWeights(fit);
}

void FitAnew(Fit* fit) {
  constexpr int kRounds = 2;
  UpdateResiduals(fit);
  StepFit(fit);
  SettleFit(fit, kRounds);
}

void FreeHomings(Fit* fit) {
  constexpr double kWide_deg = 60;
  constexpr int kRounds = 6;
  const std::size_t rows = fit->facts->campaign->rows();
  for (const std::size_t axis : {kTheta, kPhi}) {
    fit->model.homing_zero_deg[axis].assign(rows, 0);
    fit->model.homing_spread_deg[axis] = kWide_deg;
  }
  SettleFit(fit, kRounds);
  for (const std::size_t axis : {kTheta, kPhi}) {
    double square = 0;
    for (const double zero : fit->model.homing_zero_deg[axis]) square += zero * zero;
    fit->model.homing_spread_deg[axis] = 2 * std::sqrt(square / static_cast<double>(rows)) + 0.001;
  }
  SettleFit(fit, 3);
}

double CountParameters(const Fit& fit) {
  double parameters = 2 * static_cast<double>(MovesWithEvents(fit.model));
  parameters += kExposureParameters * static_cast<double>(fit.model.exposures.size());
  const std::size_t freed = fit.model.homing_zero_deg[kTheta].empty() ? 0 : fit.model.units.size();
  for (std::size_t unit = 0; unit < freed; ++unit) {
    // The first zero of each axis belongs to the geometry.
    const UnitTrack track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
    const auto homings = static_cast<double>(FreeHomingsOf(fit.model, track).size());
    parameters += std::max(homings - 2, 0.0);
  }
  for (const ModelTerm& term : fit.model.terms) {
    for (std::size_t k = 0; k < term.amplitude.size(); ++k)
      if (term.sigma[k] > 0) parameters += 1;
    for (std::size_t unit = 0; unit < term.group_of_unit.size(); ++unit)
      if (term.group_of_unit[unit] != kNoGroup &&
          term.form.shape_of_unit.contains(fit.model.units[unit].id))
        parameters += 1;
  }
  return parameters;
}

// The price of units' own amplitudes is that of their marginal likelihood (Laplace), with the
// spread that they have: ln(1 + s^2 / sigma^2) + a^2 / (s^2 + sigma^2) each, about their mean.
// BIC's ln n, with the rows of all units, would count rows that say nothing of an amplitude. The
// prior's width is no part of it, so that terms with different priors compare.
double PriceOfOwn(const ModelTerm& term) {
  double square = 0, count = 0;
  const auto from_mean2 = [&](std::size_t k) { return std::pow(term.amplitude[k] - term.mean, 2); };
  for (std::size_t k = 0; k < term.amplitude.size(); ++k)
    if (term.sigma[k] > 0) square += from_mean2(k) - std::pow(term.sigma[k], 2), count += 1;
  if (count == 0) return 0;
  const double spread2 = std::max(square / count, 0.0);
  double price = 0;
  for (std::size_t k = 0; k < term.amplitude.size(); ++k) {
    const double sigma2 = std::pow(term.sigma[k], 2);
    if (sigma2 > 0) price += std::log1p(spread2 / sigma2) + from_mean2(k) / (spread2 + sigma2);
  }
  return price;
}

// The price of choosing which units have a term, with any number of them as likely: so many choices
// fit by chance.
double PriceOfUnits(const ModelTerm& term) {
  const auto units = static_cast<double>(term.group_of_unit.size());
  const auto without = static_cast<double>(std::ranges::count(term.group_of_unit, kNoGroup));
  if (without == 0) return 0;
  return 2 * (std::lgamma(units + 2) - std::lgamma(without + 1) - std::lgamma(units - without + 1));
}

double PriceOf(const Fit& fit) {
  double values = 0;
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.Used(row)) values += 2;
  double parameters = CountParameters(fit), own = 0;
  for (const ModelTerm& term : fit.model.terms) {
    if (!(term.spread > 0)) continue;
    for (const double sigma : term.sigma) parameters -= sigma > 0 ? 1 : 0;
    parameters += term.has_mean ? 2 : 1;  // the spread, and the mean
    own += PriceOfOwn(term) + PriceOfUnits(term);
  }
  return parameters * std::log(std::max(values, 2.0)) + own + PriceOfDiscrepancies(fit.model);
}

double NegativeBic(const Fit& fit) {
  double log_density = 0;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const auto at = static_cast<Index>(2 * k);
      const double* w = white.filter[k].w;
      const double weight = fit.weight[white.track.first_row + white.moves[k]];
      const double square = white.y.segment(at, 2).squaredNorm() / weight;
      log_density += std::log(std::max((w[0] * w[2] - w[1] * w[1]) / weight, 1e-300)) -
                     MinusLogDensity(square);
    }
  }
  return 2 * log_density - PriceOf(fit);
}

StaticMatrix StaticCovariance(const Fit& fit, std::size_t unit) {
  const WhiteUnit white = Whiten(fit, unit);
  std::vector<Index> none(fit.model.terms.size() + fit.model.discrepancies.size() + 1, 0);
  const UnitEquations eq = MakeEquations(fit, unit, white, none);
  MatrixXd normal = eq.own.transpose() * eq.own;
  normal.diagonal() += eq.prior;
  normal.diagonal().array() += kNoData;
  const Index n = normal.rows();
  return normal.ldlt().solve(MatrixXd::Identity(n, n)).topLeftCorner<6, 6>();
}

}  // namespace focalfleet::sim
