// A unit's static geometry as six numbers: base x and y, both arms, in mm; both zeros, in degrees.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cstddef>

#include "sim/campaign/campaign.h"

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

/// Arms stay longer than nothing.
inline void AddStatic(const StaticVector& step, CampaignUnit* unit) {
  constexpr double kArmMin_mm = 1e-3;
  const StaticVector v = ToVector(*unit) + step;
  unit->base_x_mm = v[0], unit->base_y_mm = v[1];
  unit->arm_mm[kTheta] = std::max(v[2], kArmMin_mm);
  unit->arm_mm[kPhi] = std::max(v[3], kArmMin_mm);
  unit->zero_deg[kTheta] = v[4], unit->zero_deg[kPhi] = v[5];
}

/// Wide: what the moves do not show stays where units.csv has it. Per mm^2 and degree^2.
inline StaticVector StaticPriorWeights() {
  constexpr double kBase_mm = 2, kArm_mm = 0.5, kZero_deg = 180;
  StaticVector spread;
  spread << kBase_mm, kBase_mm, kArm_mm, kArm_mm, kZero_deg, kZero_deg;
  return spread.array().square().inverse();
}

}  // namespace focalfleet::sim
