// The sensors that a unit's board reads where its fibre stands on a ball-jointed fibre carrier. The
// interface stands here because magnets and their field are a library of their own (sim/hall),
// which does not depend on units.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/ids.h"

namespace focalfleet::sim {

/// Frame: focal plane, from the unit's base, where the joint is. Units: mm.
struct FibreCarrierTip {
  double x_mm = 0;
  double y_mm = 0;
  double length_mm = 0;  // of the fibre carrier
};

class JointSensors {
 public:
  JointSensors() = default;
  JointSensors(const JointSensors&) = delete;
  JointSensors& operator=(const JointSensors&) = delete;
  virtual ~JointSensors() = default;

  /// A reading of the sensors of this unit, with noise of its own. The same unit, number and tip
  /// give the same reading again. Shape: one count a sensor.
  virtual void Read(UnitId unit, std::uint32_t reading, const FibreCarrierTip& tip,
                    std::span<std::uint16_t> counts) const = 0;
};

}  // namespace focalfleet::sim
