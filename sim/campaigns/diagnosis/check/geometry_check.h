// A check tells whether a fitted geometry can be that of the unit which the table describes.
#pragma once

#include <cmath>
#include <cstddef>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// Whether the fitted unit can be the one that the table describes. A fit moves a base by its play
/// on the plate and an arm by its tolerance, not to another unit.
struct GeometryCheck {
  bool base = false, arms = false;
  [[nodiscard]] bool passes() const { return base && arms; }
};
inline GeometryCheck CheckGeometry(const CampaignUnit& described, const CampaignUnit& fitted) {
  // A neighbour's base is a pitch away, 10.4 mm on the plates here. Twice of the bound would take
  // it for the unit's own; half of it still leaves room for any play. Arms in service scatter by
  // 0.057 mm, 2 % of 3 mm (sim/world/spread.cc). Half of that bound is 12 times the scatter; twice
  // of it accepts an arm of no length.
  constexpr double kBase_mm = 10;
  constexpr double kArmShare = 0.5;
  GeometryCheck check;
  check.base = std::hypot(fitted.base_x_mm - described.base_x_mm,
                          fitted.base_y_mm - described.base_y_mm) <= kBase_mm;
  check.arms = true;
  for (const std::size_t axis : {kTheta, kPhi})
    check.arms = check.arms && fitted.arm_mm[axis] > 0 &&
                 std::abs(fitted.arm_mm[axis] / described.arm_mm[axis] - 1) <= kArmShare &&
                 std::isfinite(fitted.zero_deg[axis]);
  return check;
}

}  // namespace focalfleet::sim
