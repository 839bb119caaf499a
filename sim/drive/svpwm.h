// Space vector modulation as a timer does it. A table of `subdivision` voltage vectors has length
// V_bus / sqrt(3); each is shown for `repeat` carrier periods of `counter1` timer counts. A vector
// at angle a past its sector's first active vector divides a carrier period into
//
//   T1 = C sin(60 deg - a),  T2 = C sin(a),  T0 = C - T1 - T2        (paper 1 eq. 4, all sectors)
//
// The three wave modes differ only in where these three parts lie (paper 1 Fig. 14):
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

/// The part of a carrier period in which a leg is commanded high. Units: timer counts. on == off:
/// the leg stays low.
struct Pulse {
  double on = 0;
  double off = 0;
  [[nodiscard]] bool none() const { return on >= off; }
};
using Pattern = std::array<Pulse, kLegCount>;

/// The pattern of the vector at 2 pi * index / subdivision. Pre: 0 <= index < subdivision.
Pattern PatternOf(const Modulation& modulation, int index);

/// The patterns of all vectors. Shape: (subdivision).
std::vector<Pattern> VectorTable(const Modulation& modulation);

}  // namespace focalfleet::sim
