// The true place of the fibre: two rotations, one inside the other, as products of unit complex
// numbers. The geometry is the one that was built, which the description need not match.
#pragma once

#include <array>
#include <complex>

#include "protocol/base/ids.h"
#include "sim/world/unit_description.h"

namespace focalfleet::sim {

/// The geometry as built. Units: mm, degrees. Frame: focal plane, counter-clockwise from the sky
/// side.
struct Mechanism {
  std::complex<double> base_mm;
  std::array<double, kAxisCount> arm_mm{};
  std::array<double, kAxisCount> zero_deg{};
};

/// A mechanism built exactly to its description.
Mechanism BuiltAsDescribed(const UnitDescription& description);

/// The place of the fibre with the axes at these output angles. Frame: focal plane, mm.
std::complex<double> FibreAt(const Mechanism& mechanism,
                             const std::array<double, kAxisCount>& angle_deg);

}  // namespace focalfleet::sim
