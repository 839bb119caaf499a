#include "sim/campaigns/diagnosis/terms/image_followed.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace focalfleet::sim {
namespace {

// Mean of a column at each exposure that was seen; empty where units differ, or where it does not
// vary.
std::vector<double> OfExposures(const CampaignFacts& facts, const FilledColumn& column,
                                const std::vector<std::size_t>& seen) {
  constexpr double kOwnShareMax = 0.1;  // of the variance: the part of single units
  const std::size_t exposures = facts.exposures.size();
  std::vector<double> mean(exposures, 0), count(exposures, 0);
  double square = 0;
  for (std::size_t row = 0; row < column.values.size(); ++row) {
    const std::size_t e = facts.exposures.of_row[row];
    mean[e] += column.values[row], count[e] += 1;
    square += (column.values[row] - column.mean) * (column.values[row] - column.mean);
  }
  double between = 0;
  for (std::size_t e = 0; e < exposures; ++e) {
    mean[e] /= std::max(count[e], 1.0);
    between += count[e] * (mean[e] - column.mean) * (mean[e] - column.mean);
  }
  if (!(square > 0) || between < (1 - kOwnShareMax) * square) return {};
  std::vector<double> of_seen;
  for (const std::size_t e : seen) of_seen.push_back(mean[e]);
  return of_seen;
}

// Share of the shifts' variance that curves over the ranks of `values` take, or with `by_value` the
// value, its square and its cube.
double ShareTaken(const std::vector<ImageMotion>& shifts, const std::vector<double>& values,
                  int curves, bool by_value) {
  const auto n = static_cast<Eigen::Index>(shifts.size());
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  Eigen::MatrixXd basis(n, curves + 1), two(n, 2);
  for (Eigen::Index e = 0; e < n; ++e) {
    const double value = values[static_cast<std::size_t>(e)];
    const auto range = std::equal_range(sorted.begin(), sorted.end(), value);
    const double rank =
        static_cast<double>((range.first - sorted.begin()) + (range.second - sorted.begin())) /
        (2 * static_cast<double>(n));
    basis(e, 0) = 1;
    const double scaled =
        (value - sorted.front()) / std::max(sorted.back() - sorted.front(), 1e-300);
    for (int k = 1; k <= curves; ++k)
      basis(e, k) = by_value ? std::pow(scaled, k) : std::cos(std::numbers::pi * k * rank);
    two.row(e) = shifts[static_cast<std::size_t>(e)].head<2>().transpose();
  }
  two.rowwise() -= two.colwise().mean().eval();
  const Eigen::MatrixXd left = two - basis * basis.colPivHouseholderQr().solve(two);
  const double all = two.squaredNorm();
  return all > 0 ? 1 - left.squaredNorm() / all : 0;
}

// Evidence of curves that take a share of n shifts' variance, by the Bayesian information
// criterion.
double EvidenceOf(double share, double coefficients, std::size_t n) {
  return -2 * static_cast<double>(n) * std::log1p(-std::min(share, 0.9999)) -
         2 * coefficients * std::log(static_cast<double>(n));
}

// The largest share of the shifts' variance that a single sine over time takes.
double ShareOfSine(const std::vector<ImageMotion>& shifts, const std::vector<double>& time) {
  constexpr double kHalvesMin = 0.5, kHalvesMax = 24, kStep = 0.25;  // half periods
  const auto n = static_cast<Eigen::Index>(shifts.size());
  const auto [first, last] = std::minmax_element(time.begin(), time.end());
  if (!(*last > *first)) return 0;
  Eigen::MatrixXd two(n, 2), basis(n, 3);
  for (Eigen::Index e = 0; e < n; ++e)
    two.row(e) = shifts[static_cast<std::size_t>(e)].head<2>().transpose();
  two.rowwise() -= two.colwise().mean().eval();
  const double all = two.squaredNorm();
  double most = 0;
  for (double halves = kHalvesMin; halves <= kHalvesMax; halves += kStep) {
    for (Eigen::Index e = 0; e < n; ++e) {
      const double share = (time[static_cast<std::size_t>(e)] - *first) / (*last - *first);
      const double phase = std::numbers::pi * halves * share;
      basis.row(e) << 1, std::sin(phase), std::cos(phase);
    }
    const Eigen::MatrixXd left = two - basis * basis.colPivHouseholderQr().solve(two);
    most = std::max(most, 1 - left.squaredNorm() / std::max(all, 1e-300));
  }
  return most;
}

// The largest share that a single step takes.
double ShareOfStep(const std::vector<ImageMotion>& shifts) {
  std::vector<double> behind(shifts.size(), 1);
  double most = 0;
  for (std::size_t e = 0; e + 1 < shifts.size(); ++e) {
    behind[e] = 0;
    most = std::max(most, ShareTaken(shifts, behind, 1, false));
  }
  return most;
}

}  // namespace

std::optional<UnknownFound> FollowedColumn(const CampaignFacts& facts,
                                           const std::vector<std::size_t>& seen,
                                           const std::vector<ImageMotion>& shifts, double signal,
                                           double size_um) {
  constexpr int kCurves = 3, kTimeCurves = 6;
  constexpr double kShareMin = 0.25;  // of the signal
  constexpr double kSineMin = 0.85;   // a wandering image has less of one sine
  constexpr double kClearly = 15;
  const std::size_t exposures = seen.size();
  if (exposures < 20) return std::nullopt;
  std::vector<double> order, parity;
  for (const std::size_t e : seen)
    order.push_back(static_cast<double>(e)), parity.push_back(static_cast<double>(e % 2));
  const double by_time =
      EvidenceOf(ShareTaken(shifts, order, kTimeCurves, false), kTimeCurves, exposures);
  std::optional<UnknownFound> best;
  const double by_step = EvidenceOf(ShareOfStep(shifts), 2, exposures);
  double most = std::max({by_time, by_step, 0.0}) + kClearly;
  const auto look = [&](const std::string& name, const std::vector<double>& values, int curves) {
    const double share = std::max(ShareTaken(shifts, values, curves, false),
                                  ShareTaken(shifts, values, curves, true));
    const double evidence = EvidenceOf(share, curves, exposures);
    if (evidence < most || share < kShareMin * signal) return;
    most = evidence;
    best = UnknownFound{name, std::string(kImageShift), std::exp(-evidence / 2),
                        size_um * std::sqrt(share)};
  };
  look("move parity", parity, 1);
  for (const auto& [name, column] : facts.columns) {
    if (!column.varies() || name == kOrder || name == "t_s" || name.starts_with("pixel_")) continue;
    const std::vector<double> values = OfExposures(facts, column, seen);
    if (!values.empty()) look(name, values, kCurves);
  }
  if (best) return best;
  const FilledColumn* clock = facts.Find("t_s");
  const std::vector<double> time = clock == nullptr ? order : OfExposures(facts, *clock, seen);
  const double sine = ShareOfSine(shifts, time.empty() ? order : time);
  if (sine > kSineMin * signal &&
      EvidenceOf(sine, 3, exposures) > std::max(by_step, 0.0) + kClearly)
    best = UnknownFound{"t_s", std::string(kImageShift) + ", one slow wave",
                        std::exp(-EvidenceOf(sine, 3, exposures) / 2), size_um * std::sqrt(sine)};
  return best;
}

}  // namespace focalfleet::sim
