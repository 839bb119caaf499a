#include "sim/hall/spherical_fit.h"

#include <Eigen/Dense>
#include <algorithm>

namespace focalfleet::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kIdealDegree = 36;
constexpr int kAnyDegree = 18;
constexpr std::size_t kPointsForUnlike = 100;
constexpr std::size_t kPointsForAllOrders = 12'000;  // more points cost time and gain nothing
constexpr double kEvidenceForUnlike = 10;

struct Column {
  int degree = 0;
  int order = 0;
  bool sine = false;
};

// Eight equal alternating poles have period 90 deg and change sign after 45 deg.
std::vector<Column> IdealColumns() {
  std::vector<Column> columns;
  for (int order = 4; order <= kIdealDegree; order += 8)
    for (int degree = order; degree <= kIdealDegree; ++degree)
      for (const bool sine : {false, true}) columns.push_back({degree, order, sine});
  return columns;
}

std::vector<Column> AllColumns() {
  std::vector<Column> columns = IdealColumns();
  for (int order = 0; order <= kAnyDegree; ++order) {
    if (order % 8 == 4) continue;
    // No flux leaves a sphere around the whole rotor: degree 0 is absent.
    for (int degree = std::max(order, 1); degree <= kAnyDegree; ++degree) {
      columns.push_back({degree, order, false});
      if (order > 0) columns.push_back({degree, order, true});
    }
  }
  return columns;
}

// The basis functions of one point, by order: one pass of the recurrence each.
void FillRow(const std::vector<Column>& columns, const FieldPoint& point, double* row) {
  const double z = std::cos(point.theta_rad), s = std::sin(point.theta_rad);
  std::vector<double> p(kDegreeMax + 1);
  int order = -1;
  double cosine = 1, sine = 0;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (columns[k].order != order) {
      order = columns[k].order;
      const double sin_power = std::pow(s, order);
      cosine = sin_power * std::cos(order * point.phi_rad);
      sine = sin_power * std::sin(order * point.phi_rad);
      double before = 0, now = FirstOfOrder(order);
      p[static_cast<std::size_t>(order)] = now;
      for (int degree = order + 1; degree <= kIdealDegree; ++degree) {
        const LegendreStep step = StepToDegree(degree, order);
        const double next = step.up * z * now - step.back * before;
        before = now;
        now = next;
        p[static_cast<std::size_t>(degree)] = now;
      }
    }
    row[k] = p[static_cast<std::size_t>(columns[k].degree)] * (columns[k].sine ? sine : cosine);
  }
}

struct Normal {
  MatrixXd matrix;
  VectorXd right;
  double squares = 0;
  double points = 0;
};
Normal Accumulate(const std::vector<Column>& columns, const FieldMap& map, std::size_t stride) {
  const auto size = static_cast<Eigen::Index>(columns.size());
  Normal normal{MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  constexpr Eigen::Index kBlock = 256;
  MatrixXd rows(size, kBlock);
  VectorXd values(kBlock);
  Eigen::Index filled = 0;
  const auto flush = [&] {
    const auto used = rows.leftCols(filled);
    normal.matrix.selfadjointView<Eigen::Lower>().rankUpdate(used);
    normal.right.noalias() += used * values.head(filled);
    filled = 0;
  };
  for (std::size_t k = 0; k < map.size(); k += stride) {
    FillRow(columns, map[k], rows.col(filled).data());
    values[filled] = map[k].b_T;
    normal.squares += map[k].b_T * map[k].b_T;
    normal.points += 1;
    if (++filled == kBlock) flush();
  }
  flush();
  normal.matrix.triangularView<Eigen::StrictlyUpper>() = normal.matrix.transpose();
  return normal;
}

struct Prior {
  // The factor by which a coefficient's expected size falls from degree to degree.
  double falloff = 0.8;
  double ratio = 1;   // noise variance over a coefficient's at degree 4
  double unlike = 1;  // size of the coefficients that only unlike magnets make, over the others
};
struct Posterior {
  Prior prior;
  double log_evidence = -1e300;
  double noise_T = 0;
  VectorXd mean;
  VectorXd sd;
};

Posterior Solve(const std::vector<Column>& columns, const Normal& normal, const Prior& prior,
                bool with_sd) {
  Posterior posterior{.prior = prior};
  MatrixXd matrix = normal.matrix;
  double log_prior = 0;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const double size = std::pow(prior.falloff, std::max(0, columns[k].degree - 4)) *
                        (columns[k].order % 8 == 4 ? 1 : prior.unlike);
    const double precision = prior.ratio / (size * size);
    const auto i = static_cast<Eigen::Index>(k);
    matrix(i, i) += precision;
    log_prior += std::log(precision);
  }
  const Eigen::LLT<MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) return posterior;
  posterior.mean = factor.solve(normal.right);
  const double floor = 1e-15 * normal.squares;
  const double quadratic = std::max(floor, normal.squares - normal.right.dot(posterior.mean));
  const double variance = quadratic / normal.points;
  double log_determinant = 0;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    log_determinant += 2 * std::log(factor.matrixLLT()(i, i));
  posterior.log_evidence =
      -0.5 * (normal.points * std::log(variance) + log_determinant - log_prior);
  posterior.noise_T = std::sqrt(variance);
  if (with_sd)
    posterior.sd =
        (variance * factor.solve(MatrixXd::Identity(matrix.rows(), matrix.cols())).diagonal())
            .cwiseSqrt();
  return posterior;
}

Posterior BestOf(const std::vector<Column>& columns, const Normal& normal,
                 const std::vector<Prior>& priors) {
  Posterior best;
  for (const Prior& prior : priors)
    if (Posterior trial = Solve(columns, normal, prior, false);
        trial.log_evidence > best.log_evidence)
      best = std::move(trial);
  return Solve(columns, normal, best.prior, true);
}

std::vector<Prior> Priors(double points) {
  std::vector<Prior> priors;
  for (const double falloff : {0.6, 0.68, 0.76, 0.84, 0.92})
    for (double power = -14; power <= 1; power += 1)
      priors.push_back({falloff, points * std::pow(10, power)});
  return priors;
}

// The falloff is known from the ideal fit; magnets differ by percents.
std::vector<Prior> PriorsOfUnlike(const Prior& ideal, double points) {
  std::vector<Prior> priors;
  for (const double unlike : {0.1, 0.03, 0.01, 0.003})
    for (double power = -14; power <= 1; power += 2)
      priors.push_back({ideal.falloff, points * std::pow(10, power), unlike});
  priors.push_back(ideal);
  return priors;
}

}  // namespace

SphericalFit FitSpherical(const FieldMap& map) {
  std::vector<Column> columns = IdealColumns();
  const Normal ideal = Accumulate(columns, map, 1);
  Posterior posterior = BestOf(columns, ideal, Priors(ideal.points));
  SphericalFit fit;
  // Unlike magnets deserve their coefficients where the same points are explained better.
  if (map.size() >= kPointsForUnlike) {
    const std::size_t stride = (map.size() + kPointsForAllOrders - 1) / kPointsForAllOrders;
    const Normal thinned = stride == 1 ? ideal : Accumulate(columns, map, stride);
    const double without =
        BestOf(columns, thinned, PriorsOfUnlike(posterior.prior, thinned.points)).log_evidence;
    const std::vector<Column> all = AllColumns();
    const Normal any = Accumulate(all, map, stride);
    const Posterior with = BestOf(all, any, PriorsOfUnlike(posterior.prior, any.points));
    if (with.log_evidence > without + kEvidenceForUnlike) {
      posterior = with;
      columns = all;
      fit.all_orders = true;
    }
  }
  fit.noise_T = posterior.noise_T;
  const double least_T = 1e-7 * std::sqrt(ideal.squares / ideal.points);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    if (std::abs(posterior.mean[i]) < least_T) continue;
    const Column& column = columns[k];
    const auto same = std::find_if(fit.terms.begin(), fit.terms.end(), [&](const auto& term) {
      return term.degree == column.degree && term.order == column.order;
    });
    SphericalTerm& term =
        same != fit.terms.end()
            ? *same
            : fit.terms.emplace_back(SphericalTerm{column.degree, column.order, 0, 0, 0, 0});
    (column.sine ? term.sine_T : term.cosine_T) = posterior.mean[i];
    (column.sine ? term.sd_sine_T : term.sd_cosine_T) = posterior.sd[i];
  }
  return fit;
}

}  // namespace focalfleet::sim
