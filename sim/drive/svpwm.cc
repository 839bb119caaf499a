#include "sim/drive/svpwm.h"

#include <cmath>
#include <numbers>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

// The legs that a sector switches: one is high for T1 + T2, another for one of both. Even sectors
// begin with their own vector (T1), odd ones with the next (T2); the leg that is high longest
// belongs to it.
struct Sector {
  std::size_t longest;
  std::size_t second;
  bool second_is_high_in_t1;
};
constexpr std::array<Sector, 6> kSectors = {{
    {0, 1, false},  // 100 110
    {1, 0, true},   // 110 010
    {1, 2, false},  // 010 011
    {2, 1, true},   // 011 001
    {2, 0, false},  // 001 101
    {0, 2, true},   // 101 100
}};

// The pulse as near to the middle of the period as whole counts allow.
Pulse Centred(double counts, double period) {
  const double width = std::round(counts);
  const double on = std::floor((period - width) / 2);
  return {on, on + width};
}

}  // namespace

Pattern PatternOf(const Modulation& modulation, int index) {
  FOCALFLEET_CHECK(modulation.subdivision > 0 && index >= 0 && index < modulation.subdivision);
  // The angle is computed in integers, so that vectors on a sector's border stand exactly there.
  const int sixfold = 6 * index;
  const auto sector = static_cast<std::size_t>(sixfold / modulation.subdivision);
  const double past = static_cast<double>(sixfold % modulation.subdivision) /
                      modulation.subdivision * (std::numbers::pi / 3);
  const double period = modulation.counter1;
  const double t1 = period * std::sin(std::numbers::pi / 3 - past);
  const double t2 = period * std::sin(past);
  const double t0 = period - t1 - t2;
  const Sector& legs = kSectors[sector];
  const double second = legs.second_is_high_in_t1 ? t1 : t2;
  Pattern pattern{};
  switch (modulation.mode) {
    case WaveMode::kAsymmetric:
      pattern[legs.longest] = {std::round(t0), period};
      pattern[legs.second] = {period - std::round(second), period};
      break;
    case WaveMode::kFiveSegment:
      pattern[legs.longest] = Centred(t1 + t2, period);
      pattern[legs.second] = Centred(second, period);
      break;
    case WaveMode::kSevenSegment: {
      const std::size_t shortest = 3 - legs.longest - legs.second;
      pattern[legs.longest] = Centred(t1 + t2 + t0 / 2, period);
      pattern[legs.second] = Centred(second + t0 / 2, period);
      pattern[shortest] = Centred(t0 / 2, period);
      break;
    }
  }
  return pattern;
}

std::vector<Pattern> VectorTable(const Modulation& modulation) {
  std::vector<Pattern> table;
  table.reserve(static_cast<std::size_t>(modulation.subdivision));
  for (int index = 0; index < modulation.subdivision; ++index)
    table.push_back(PatternOf(modulation, index));
  return table;
}

}  // namespace focalfleet::sim
