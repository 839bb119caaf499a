// A unit's static geometry as six numbers: base x and y, both arms, in mm; both zeros, in degrees.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

inline constexpr std::size_t kStaticColumns = 6;
using StaticVector = Eigen::Matrix<double, 6, 1>;
using StaticMatrix = Eigen::Matrix<double, 6, 6>;

inline StaticVector ToVector(const CampaignUnit& unit) {
  StaticVector v;
  v << unit.base_x_mm, unit.base_y_mm, unit.arm_mm[kTheta], unit.arm_mm[kPhi],
      unit.zero_deg[kTheta], unit.zero_deg[kPhi];
  return v;
}

/// Adds the step to the unit; arms stay longer than zero.
inline void AddStatic(const StaticVector& step, CampaignUnit* unit) {
  constexpr double kArmMin_mm = 1e-3;
  const StaticVector v = ToVector(*unit) + step;
  unit->base_x_mm = v[0], unit->base_y_mm = v[1];
  unit->arm_mm[kTheta] = std::max(v[2], kArmMin_mm);
  unit->arm_mm[kPhi] = std::max(v[3], kArmMin_mm);
  unit->zero_deg[kTheta] = v[4], unit->zero_deg[kPhi] = v[5];
}

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

/// Weights of a wide prior: what the moves do not show stays as in units.csv. Per mm^2 and
/// degree^2.
inline StaticVector StaticPriorWeights() {
  constexpr double kBase_mm = 2, kArm_mm = 0.5, kZero_deg = 180;
  StaticVector spread;
  spread << kBase_mm, kBase_mm, kArm_mm, kArm_mm, kZero_deg, kZero_deg;
  return spread.array().square().inverse();
}

}  // namespace focalfleet::sim
