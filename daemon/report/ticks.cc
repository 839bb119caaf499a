#include "daemon/report/ticks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string_view>

#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

struct Step {
  std::int64_t mantissa;  // 1, 2 or 5
  int exponent;
};

// mantissa * 10^exponent, with a single rounding (of a division) where 10^exponent is not exact.
double Scaled(std::int64_t mantissa, int exponent) {
  const auto number = static_cast<double>(mantissa);
  return exponent < 0 ? number / std::pow(10.0, -exponent) : number * std::pow(10.0, exponent);
}

Step NextLonger(Step step) {
  if (step.mantissa == 1) return {2, step.exponent};
  if (step.mantissa == 2) return {5, step.exponent};
  return {1, step.exponent + 1};
}

struct Multiples {
  std::int64_t first;
  std::int64_t last;
};

// The multiples of the step inside the range, including an end that rounding alone would exclude.
Multiples Inside(Range range, Step step) {
  const double length = Scaled(step.mantissa, step.exponent);
  const double slack = 1e-9;
  return {static_cast<std::int64_t>(std::ceil(range.low / length - slack)),
          static_cast<std::int64_t>(std::floor(range.high / length + slack))};
}

int SharedExponent(double magnitude_max) {
  if (magnitude_max < 1e5 && magnitude_max >= 1e-2) return 0;
  return 3 * static_cast<int>(std::floor(std::log10(magnitude_max) / 3 + 1e-9));
}

// All labels of one axis use one notation: without powers of ten where all its numbers are handy.
std::string LogLabel(std::int64_t mantissa, int exponent, bool handy) {
  if (handy) return fmt::format("{:.{}f}", Scaled(mantissa, exponent), std::max(0, -exponent));
  const std::string power = PowerOfTen(exponent);
  return mantissa == 1 ? power : fmt::format("{}·{}", mantissa, power);
}

}  // namespace

std::string PowerOfTen(int exponent) {
  constexpr std::string_view kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out = exponent < 0 ? "10⁻" : "10";
  for (const char digit : fmt::format("{}", std::abs(exponent))) {
    out += kDigits[static_cast<std::size_t>(digit - '0')];
  }
  return out;
}

Ticks LinearTicks(Range range, int count_max) {
  FOCALFLEET_CHECK(range.low < range.high && count_max > 1);
  const double span = range.high - range.low;
  Step step{1, static_cast<int>(std::floor(std::log10(span / count_max))) - 1};
  Multiples multiples = Inside(range, step);
  while (multiples.last - multiples.first >= count_max) {
    step = NextLonger(step);
    multiples = Inside(range, step);
  }
  Ticks ticks;
  const double magnitude_max = std::max(std::abs(range.low), std::abs(range.high));
  ticks.exponent = SharedExponent(magnitude_max);
  const int digits = std::max(0, ticks.exponent - step.exponent);
  for (std::int64_t k = multiples.first; k <= multiples.last; ++k) {
    const std::int64_t mantissa = k * step.mantissa;
    ticks.marks.push_back(
        {Scaled(mantissa, step.exponent),
         fmt::format("{:.{}f}", Scaled(mantissa, step.exponent - ticks.exponent), digits)});
  }
  return ticks;
}

Ticks LogTicks(Range range, int count_max) {
  FOCALFLEET_CHECK(range.low > 0 && range.low < range.high && count_max > 1);
  const int first = static_cast<int>(std::floor(std::log10(range.low)));
  const int last = static_cast<int>(std::floor(std::log10(range.high) + 1e-9));
  const bool handy = range.low > 0.00999 && range.high < 1e5;
  const auto marks_of = [&](int stride, bool within) {
    Ticks ticks;
    for (int decade = first; decade <= last; ++decade) {
      if (decade % stride != 0) continue;
      for (const std::int64_t mantissa : {1, 2, 5}) {
        const double value = Scaled(mantissa, decade);
        const bool inside = value >= range.low * (1 - 1e-9) && value <= range.high * (1 + 1e-9);
        if (inside && (mantissa == 1 || within)) {
          ticks.marks.push_back({value, LogLabel(mantissa, decade, handy)});
        }
      }
    }
    return ticks;
  };
  const auto limit = static_cast<std::size_t>(count_max);
  if (Ticks fine = marks_of(1, true); fine.marks.size() <= limit) {
    // Fewer than three marks would leave a reader without the scale.
    return fine.marks.size() < 3 ? LinearTicks(range, count_max) : fine;
  }
  int stride = 1;
  Ticks decades = marks_of(stride, false);
  while (decades.marks.size() > limit) decades = marks_of(++stride, false);
  return decades;
}

}  // namespace focalfleet::report
