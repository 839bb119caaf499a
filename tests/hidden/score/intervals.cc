#include "tests/hidden/score/intervals.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::hidden {

namespace {

// P(X <= hits) of a binomial with this share, summed in logarithms.
double AtMost(int hits, int trials, double share) {
  if (share <= 0) return 1;
  if (share >= 1) return hits >= trials ? 1 : 0;
  double sum = 0;
  for (int k = 0; k <= hits; ++k)
    sum +=
        std::exp(std::lgamma(trials + 1.0) - std::lgamma(k + 1.0) - std::lgamma(trials - k + 1.0) +
                 k * std::log(share) + (trials - k) * std::log1p(-share));
  return std::min(1.0, sum);
}

// The share at which a decreasing function falls below `level`.
template <class Function>
double Root(const Function& function, double level) {
  double low = 0;
  double high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (function(middle) > level ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

Interval Wilson(int hits, int trials) {
  if (trials <= 0) return {};
  const double z = 1.959963984540054;
  const double n = trials;
  const double share = hits / n;
  const double middle = (share + z * z / (2 * n)) / (1 + z * z / n);
  const double half =
      z / (1 + z * z / n) * std::sqrt(share * (1 - share) / n + z * z / (4 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

Interval ClopperPearson(int hits, int trials) {
  if (trials <= 0) return {};
  Interval out;
  if (hits > 0)
    out.low = Root([&](double share) { return AtMost(hits - 1, trials, share); }, 1 - 0.025);
  if (hits < trials)
    out.high = Root([&](double share) { return AtMost(hits, trials, share); }, 0.025);
  return out;
}

}  // namespace focalfleet::hidden
