#include "sim/world/mechanism.h"

#include <numbers>

namespace focalfleet::sim {

Mechanism BuiltAsDescribed(const UnitDescription& description) {
  Mechanism mechanism{{description.base_x_mm, description.base_y_mm}, {}, {}};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    mechanism.arm_mm[i] = description.axis[i].arm_mm;
    mechanism.zero_deg[i] = description.axis[i].zero_deg;
  }
  return mechanism;
}

std::complex<double> FibreAt(const Mechanism& mechanism,
                             const std::array<double, kAxisCount>& angle_deg) {
  // The sum goes from the tip inwards: each joint turns all that lies beyond it.
  std::complex<double> beyond = 0;
  for (std::size_t joint = kAxisCount; joint-- > 0;) {
    const double turn = (angle_deg[joint] + mechanism.zero_deg[joint]) * std::numbers::pi / 180;
    beyond = std::polar(1.0, turn) * (mechanism.arm_mm[joint] + beyond);
  }
  return mechanism.base_mm + beyond;
}

}  // namespace focalfleet::sim
