// Tail probabilities of statistics, as natural logarithms, down to where ordinary numbers
// underflow. The chance of a family of correlated tests follows from its effective number of tests.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace focalfleet::sim {

/// Share of the family-wise rate that each search of what is left has: structures, exposures, fine
/// structure, clusters, and neighbours pushed apart. All five together err at most 1.5 times as
/// often as that rate. Half and double of it for neighbours pushed apart: docs/diagnosis.md. For
/// the other four they have not been measured.
inline constexpr double kShareOfSearch = 0.3;

/// Degrees of freedom of Student's t in two dimensions, by which a likelihood judges a whitened
/// place. An outlier costs the logarithm of its distance, so that its noise does not decide.
inline constexpr double kPlaceFreedom = 5;
/// Minus the log density of a squared whitened length, without the constant part.
inline double MinusLogDensity(double square) {
  return (kPlaceFreedom + 2) / 2 * std::log1p(square / kPlaceFreedom);
}

/// ln P(chi-square of `dof` degrees of freedom > x). 0 for x <= 0. Pre: dof > 0.
double LogChiSquareTail(double x, double dof);

/// Chance of Fisher's F where four parameters leave no more than the share `left` of the squares,
/// with 2 a degrees of freedom left: x^a (1 + a (1 - x)). Exact. Pre: 0 <= left <= 1, a > 0.
double TailOfFourParameters(double left, double a);

/// ln of the probability that the least of `tests` independent p-values is below exp(log_p).
double LogLeastOf(double log_p, double tests);

/// ln of the number of ways to take k of n. Pre: 0 <= k <= n.
double LogChoose(double n, double k);

/// ln(sum exp(terms)); -infinity for none.
double LogSum(std::span<const double> terms);

/// The standard deviation of a normal law by the median of its deviations: 1 / Phi^-1(3/4).
inline constexpr double kSigmaOfMedian = 1.4826;

/// Lower quantile of unsorted values, by nearest rank. Pre: not empty, 0 <= share <= 1.
double Quantile(std::vector<double> values, double share);
inline double Median(std::vector<double> values) { return Quantile(std::move(values), 0.5); }
/// The median as an estimate: the mean of the two middle values of an even number. The upper one
/// alone is too large, by 1 / n of a variance. Pre: not empty.
double MiddleOf(std::vector<double> values);

}  // namespace focalfleet::sim
