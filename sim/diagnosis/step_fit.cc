// The Gauss-Newton step of fit.h.
#include <algorithm>
#include <cmath>

#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

StaticVector Table(const CampaignUnit& u) {
  StaticVector v;
  v << u.base_x_mm, u.base_y_mm, u.arm_mm[0], u.arm_mm[1], u.zero_deg[0], u.zero_deg[1];
  return v;
}

void TakeStatic(const StaticVector& v, CampaignUnit* u) {
  u->base_x_mm = v[0], u->base_y_mm = v[1];
  u->arm_mm[0] = std::max(v[2], 1e-3), u->arm_mm[1] = std::max(v[3], 1e-3);
  u->zero_deg[0] = v[4], u->zero_deg[1] = v[5];
}

// Wide: what the moves do not show stays where the table has it. mm and degrees.
StaticVector StaticPrior() {
  StaticVector w;
  w << 1 / 4.0, 1 / 4.0, 4.0, 4.0, 1 / 32400.0, 1 / 32400.0;
  return w;
}

// Homings of a unit: which one each move belongs to.
std::vector<Index> HomingOf(const UnitTrack& track, Index* homings) {
  std::vector<Index> of(track.moves);
  Index at = -1;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i] != 0) ++at;
    of[i] = at;
  }
  *homings = at + 1;
  return of;
}

bool HasHomings(const CampaignModel& model) { return !model.homing_zero_deg[kTheta].empty(); }

// One unit's equations: its own unknowns (geometry, own amplitudes, homings), and the shared ones
// that reach it.
struct UnitEquations {
  MatrixXd own;                  // columns
  VectorXd prior, value;         // weight of the prior of each unknown, and how far off it stands
  std::vector<Index> shared_at;  // which shared unknowns
  MatrixXd shared;               // columns
  VectorXd y;
  Index homings = 0;
};

void AppendColumn(const VectorXd& column, MatrixXd* columns) {
  columns->conservativeResize(column.size(), columns->cols() + 1);
  columns->col(columns->cols() - 1) = column;
}

void AppendHomings(const Fit& fit, const WhiteUnit& white, UnitEquations* eq) {
  const std::vector<Index> homing_of = HomingOf(white.track, &eq->homings);
  PoseErrors errors;
  VectorXd column(white.y.size());
  for (const std::size_t axis : {kTheta, kPhi})
    for (Index h = 0; h < eq->homings; ++h) {
      errors.Reset(white.track.moves);
      double now = 0;
      for (std::size_t i = 0; i < white.track.moves; ++i)
        if (homing_of[i] == h) {
          errors.angle_deg[axis][i] = 1;
          now = fit.model.homing_zero_deg[axis][white.track.first_row + i];
        }
      WhiteDisplacement(white, errors, column.data());
      AppendColumn(column, &eq->own);
      const double spread = std::max(fit.model.homing_spread_deg[axis], 1e-6);
      eq->prior.conservativeResize(eq->own.cols());
      eq->value.conservativeResize(eq->own.cols());
      eq->prior[eq->own.cols() - 1] = 1 / (spread * spread);
      eq->value[eq->own.cols() - 1] = now;
    }
}

UnitEquations MakeEquations(const Fit& fit, std::size_t unit, const WhiteUnit& white,
                            const std::vector<Index>& shared_begin) {
  UnitEquations eq;
  eq.y = white.y;
  eq.own = white.geometry;
  eq.prior = StaticPrior();
  eq.value = Table(fit.model.units[unit]) - Table(fit.facts->campaign->units[unit]);
  eq.shared.resize(white.y.size(), 0);
  PoseErrors errors;
  VectorXd column(white.y.size());
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const ModelTerm& term = fit.model.terms[t];
    const std::uint32_t group = term.group_of_unit[unit];
    if (group == kNoGroup) continue;
    for (std::size_t c = 0; c < term.form.columns; ++c) {
      double one[kColumnsMax] = {};
      one[c] = 1;
      errors.Reset(white.track.moves);
      term.form.effect->apply(white.track, term.form, std::span(one).first(term.form.columns),
                              &errors);
      WhiteDisplacement(white, errors, column.data());
      if (term.sharing == Sharing::kUnit) {
        AppendColumn(column, &eq.own);
        eq.prior.conservativeResize(eq.own.cols());
        eq.value.conservativeResize(eq.own.cols());
        eq.prior[eq.own.cols() - 1] = term.spread > 0 ? 1 / (term.spread * term.spread) : 0;
        eq.value[eq.own.cols() - 1] = term.amplitude[group * term.form.columns + c];
      } else {
        AppendColumn(column, &eq.shared);
        eq.shared_at.push_back(shared_begin[t] + static_cast<Index>(group * term.form.columns + c));
      }
    }
  }
  if (HasHomings(fit.model)) AppendHomings(fit, white, &eq);
  return eq;
}

struct UnitSolution {
  Eigen::LDLT<MatrixXd> own;
  VectorXd right;  // of the own unknowns
  MatrixXd cross;  // own x shared
  std::vector<Index> shared_at;
  Index homings = 0;
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
  // What neither data nor prior hold must not move.
  normal.diagonal().array() += 1e-12;
  solution.right = eq.own.transpose() * eq.y - eq.prior.cwiseProduct(eq.value);
  solution.own.compute(normal);
  solution.cross = eq.own.transpose() * eq.shared;
  solution.shared_at = eq.shared_at;
  solution.homings = eq.homings;
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

void TakeOwn(const VectorXd& step, const VectorXd& sigma, std::size_t unit, Index homings,
             Fit* fit) {
  StaticVector geometry = Table(fit->model.units[unit]);
  geometry += step.head<6>();
  TakeStatic(geometry, &fit->model.units[unit]);
  Index at = kStaticColumns;
  for (ModelTerm& term : fit->model.terms) {
    const std::uint32_t group = term.group_of_unit[unit];
    if (term.sharing != Sharing::kUnit || group == kNoGroup) continue;
    for (std::size_t c = 0; c < term.form.columns; ++c, ++at) {
      term.amplitude[group * term.form.columns + c] += step[at];
      term.sigma[group * term.form.columns + c] = sigma[at];
    }
  }
  if (!HasHomings(fit->model)) return;
  const UnitTrack track = MakeTrack(*fit->facts, unit, fit->model.units[unit]);
  Index count = 0;
  const std::vector<Index> homing_of = HomingOf(track, &count);
  for (const std::size_t axis : {kTheta, kPhi})
    for (std::size_t i = 0; i < track.moves; ++i)
      fit->model.homing_zero_deg[axis][track.first_row + i] +=
          step[at + static_cast<Index>(axis) * homings + homing_of[i]];
}

}  // namespace

void StepFit(Fit* fit) {
  const std::size_t units = fit->model.units.size();
  std::vector<Index> shared_begin;
  Index shared_count = 0;
  for (const ModelTerm& term : fit->model.terms) {
    shared_begin.push_back(shared_count);
    if (term.sharing != Sharing::kUnit) shared_count += static_cast<Index>(term.amplitude.size());
  }
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  std::vector<UnitSolution> solutions(units);
  std::vector<SharedSystem> parts(chunks.size());
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    parts[chunk] = {MatrixXd::Zero(shared_count, shared_count), VectorXd::Zero(shared_count)};
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
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
    all.normal.diagonal().array() += 1e-12;
    const Eigen::LDLT<MatrixXd> solver(all.normal);
    shared = solver.solve(all.right);
    shared_sigma = solver.solve(MatrixXd::Identity(shared_count, shared_count))
                       .diagonal()
                       .cwiseMax(0)
                       .cwiseSqrt();
  }
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t) {
    ModelTerm& term = fit->model.terms[t];
    if (term.sharing == Sharing::kUnit) continue;
    for (std::size_t k = 0; k < term.amplitude.size(); ++k) {
      term.amplitude[k] += shared[shared_begin[t] + static_cast<Index>(k)];
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
      TakeOwn(step, sigma, unit, solution.homings, fit);
    }
  });
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

double Merit(const Fit& fit) {
  const Campaign& campaign = *fit.facts->campaign;
  double values = 0, log_density = 0, parameters = 0;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const auto at = static_cast<Index>(2 * k);
      const double* w = white.filter[k].w;
      const double weight = fit.weight[white.track.first_row + white.moves[k]];
      const double square = white.y.segment(at, 2).squaredNorm() / weight;
      // Huber's density: beyond the knee the logarithm falls linearly.
      const double knee = weight < 1 ? std::sqrt(weight * square) : std::sqrt(square);
      const double cost = weight < 1 ? 2 * knee * std::sqrt(square) - knee * knee : square;
      log_density += std::log(std::max((w[0] * w[2] - w[1] * w[1]) / weight, 1e-300)) - cost / 2;
      values += 2;
    }
    if (HasHomings(fit.model)) {
      Index homings = 0;
      HomingOf(white.track, &homings);
      parameters += 2 * static_cast<double>(homings - 1);
    }
  }
  parameters += 2 * static_cast<double>(fit.model.events.size());
  for (const ModelTerm& term : fit.model.terms)
    for (std::size_t k = 0; k < term.amplitude.size(); ++k)
      if (term.sigma[k] > 0) parameters += 1;
  return 2 * log_density - parameters * std::log(std::max(values, 2.0));
}

StaticMatrix StaticCovariance(const Fit& fit, std::size_t unit) {
  const WhiteUnit white = Whiten(fit, unit);
  std::vector<Index> none(fit.model.terms.size(), 0);
  const UnitEquations eq = MakeEquations(fit, unit, white, none);
  MatrixXd normal = eq.own.transpose() * eq.own;
  normal.diagonal() += eq.prior;
  normal.diagonal().array() += 1e-12;
  const Index n = normal.rows();
  return normal.ldlt().solve(MatrixXd::Identity(n, n)).topLeftCorner<6, 6>();
}

}  // namespace focalfleet::sim
