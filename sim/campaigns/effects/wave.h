// Sine and cosine of whole arrays of angles, counted in turns. They have no branch and no call, so
// that a loop over moves costs a few operations a move. They are Taylor's series over a quarter of
// a turn either way, to the 21st power; the next term would be 1e-18. The result is within 4e-16 of
// the true value.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace focalfleet::sim {

/// The nearest whole number. Pre: |value| < 2^51.
inline double NearestWhole(double value) {
  constexpr double kNoFraction = 0x1.8p52;  // numbers near it have none
  return (value + kNoFraction) - kNoFraction;
}

/// The angle without whole turns, -180 to 180. Exact.
inline double WithoutTurns(double deg) { return deg - 360 * NearestWhole(deg / 360); }

inline constexpr std::size_t kSinePowers = 11;

/// Coefficients of sin(2 pi t) by odd powers of t.
inline constexpr std::array<double, kSinePowers> kSineSeries = [] {
  std::array<double, kSinePowers> series{};
  long double factor = 2 * std::numbers::pi_v<long double>;
  const long double square = factor * factor;
  for (std::size_t k = 0; k < kSinePowers; ++k) {
    series[k] = static_cast<double>(factor);
    const auto next = static_cast<long double>(2 * k + 2);
    factor *= -square / (next * (next + 1));
  }
  return series;
}();

inline double SineOfTurns(double turns) {
  const double rest = turns - NearestWhole(turns);
  // Beyond a quarter of a turn the sine falls as it rose.
  const double size = std::abs(rest);
  const double t = std::copysign(std::min(size, 0.5 - size), rest);
  const double square = t * t;
  double sum = kSineSeries[kSinePowers - 1];
  for (std::size_t k = kSinePowers - 1; k-- > 0;) sum = sum * square + kSineSeries[k];
  return sum * t;
}

inline double CosineOfTurns(double turns) { return SineOfTurns(turns + 0.25); }

}  // namespace focalfleet::sim
