#include "tests/hidden/score/reliability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/hidden/score/intervals.h"

namespace focalfleet::hidden {

namespace {

bool IsRight(const Case& c, const std::string& cause) {
  return c.also_true.count(cause) != 0 ||
         std::any_of(c.effects.begin(), c.effects.end(), [&](const TrueEffect& effect) {
           return effect.cause == cause || effect.equivalent.count(cause) != 0;
         });
}

}  // namespace

Reliability ReliabilityOf(const std::vector<Case>& cases) {
  Reliability bins{};
  for (const Case& c : cases)
    for (const NamedCause& named : c.named) {
      if (IsStatic(named.cause)) continue;
      for (const auto& [cause, probability] : named.posterior) {
        const double at = std::clamp(probability * 10, 0.0, 9.0);
        ReliabilityBin& bin = bins[static_cast<std::size_t>(at)];
        ++bin.count;
        bin.right += IsRight(c, cause) ? 1 : 0;
        bin.stated_sum += probability;
      }
    }
  return bins;
}

double CalibrationError(const Reliability& reliability) {
  double sum = 0, count = 0;
  for (const ReliabilityBin& bin : reliability) {
    sum += bin.count * std::abs(bin.stated() - bin.share());
    count += bin.count;
  }
  return count > 0 ? sum / count : 0;
}

std::string TableOf(const Reliability& reliability) {
  std::string text = "stated   right    of    Clopper-Pearson\n";
  for (const ReliabilityBin& bin : reliability) {
    if (bin.count == 0) continue;
    const Interval interval = ClopperPearson(bin.right, bin.count);
    std::array<char, 128> line{};
    std::snprintf(line.data(), line.size(), "%.3f    %.3f %6d    [%.4f, %.4f]\n", bin.stated(),
                  bin.share(), bin.count, interval.low, interval.high);
    text += line.data();
  }
  return text;
}

}  // namespace focalfleet::hidden
