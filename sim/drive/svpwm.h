// Space vector modulation as a timer does it: a table of `subdivision` voltage vectors of length
// V_bus / sqrt(3), each shown for `repeat` carrier periods of `counter1` timer counts. Within a
// carrier period a vector at angle a past its sector's first active vector is
//
//   T1 = C sin(60 deg - a),  T2 = C sin(a),  T0 = C - T1 - T2        (paper 1 eq. 4, all sectors)
//
// and the three wave modes differ only in where the three parts lie (paper 1 Fig. 14):
//
//   asymmetric     000 100 110                   legs are low first; 4 edges
//   five-segment   000 100 110 100 000           centred; 4 edges
//   seven-segment  000 100 110 111 110 100 000   centred; 6 edges
//
// Odd sectors go the other way round through their two active vectors, so that one leg at a time
// switches. Compare values are whole counts.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "protocol/base/ids.h"

namespace focalfleet::sim {

inline constexpr std::size_t kLegCount = 3;

struct Modulation {
  double clock_Hz = 144e6;
  int counter1 = 500;    // V_counter1: counts of a carrier period
  int repeat = 108;      // n: carrier periods a vector is shown
  int subdivision = 96;  // vectors an electrical turn; a multiple of 6
  WaveMode mode = WaveMode::kAsymmetric;

  [[nodiscard]] double carrier_s() const { return counter1 / clock_Hz; }
  [[nodiscard]] double vector_s() const { return repeat * carrier_s(); }
  /// Electrical turns a second.
  [[nodiscard]] double field_Hz() const { return 1 / (subdivision * vector_s()); }
};

/// When a leg is commanded high within a carrier period. Units: timer counts; on == off: stays low.
struct Pulse {
  double on = 0;
  double off = 0;
  [[nodiscard]] bool none() const { return on >= off; }
};
using Pattern = std::array<Pulse, kLegCount>;

/// Pattern of the vector at 2 pi * index / subdivision. Pre: 0 <= index < subdivision.
Pattern PatternOf(const Modulation& modulation, int index);

/// All of them. Shape: (subdivision).
std::vector<Pattern> VectorTable(const Modulation& modulation);

}  // namespace focalfleet::sim
