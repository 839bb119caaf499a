#include "sim/campaigns/diagnosis/model/chances.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace focalfleet::sim {
namespace {

constexpr int kTermsMax = 100000;
constexpr double kPrecise = 1e-12;

// Series of the lower regularised gamma function. Source: Abramowitz and Stegun 6.5.29.
double LowerGamma(double a, double x) {
  double term = 1 / a, sum = term;
  for (int n = 1; n < kTermsMax; ++n) {
    term *= x / (a + n);
    sum += term;
    if (term < sum * kPrecise) break;
  }
  return sum * std::exp(-x + a * std::log(x) - std::lgamma(a));
}

// Continued fraction of the upper incomplete gamma function, by Lentz. Source: Abramowitz and
// Stegun 6.5.31.
double LogUpperGamma(double a, double x) {
  constexpr double kTiny = 1e-300;
  double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, h = d;
  for (int n = 1; n < kTermsMax; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = an * d + b;
    if (std::abs(d) < kTiny) d = kTiny;
    c = b + an / c;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1 / d;
    h *= d * c;
    if (std::abs(d * c - 1) < kPrecise) break;
  }
  return -x + a * std::log(x) - std::lgamma(a) + std::log(h);
}

}  // namespace

double LogChiSquareTail(double x, double dof) {
  if (!(x > 0)) return 0;
  const double a = dof / 2, half = x / 2;
  if (half < a + 1) {
    const double lower = LowerGamma(a, half);
    return lower < 1 ? std::log1p(-lower) : -std::numeric_limits<double>::infinity();
  }
  return LogUpperGamma(a, half);
}

double LogChoose(double n, double k) {
  return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
}

double LogLeastOf(double log_p, double tests) {
  // The result is 1 - (1 - p)^n; for small n p the first term is all.
  const double p = std::exp(log_p);
  if (p * tests < 1e-6) return log_p + std::log(tests);
  if (p >= 1) return 0;
  return std::log(-std::expm1(tests * std::log1p(-p)));
}

double LogSum(std::span<const double> terms) {
  double most = -std::numeric_limits<double>::infinity();
  for (const double term : terms) most = std::max(most, term);
  if (!std::isfinite(most)) return most;
  double sum = 0;
  for (const double term : terms) sum += std::exp(term - most);
  return most + std::log(sum);
}

double Quantile(std::vector<double> values, double share) {
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  const auto it = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), it, values.end());
  return *it;
}

double MiddleOf(std::vector<double> values) {
  const auto upper = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), upper, values.end());
  if (values.size() % 2 != 0) return *upper;
  return (*std::max_element(values.begin(), upper) + *upper) / 2;
}

double TailOfFourParameters(double left, double a) {
  return std::pow(left, a) * (1 + a * (1 - left));
}

}  // namespace focalfleet::sim
