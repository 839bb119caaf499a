// A unit's static geometry as six numbers: base x and y, both arms, in mm; both zeros, in degrees.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
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

/// How far a fit's geometry may be from the one of units.csv.
enum class GeometryIs {
  kAnywhere,   // zeros have any value
  kNearTable,  // the coordinator has used the table as it is: it is off by little
  kKnown,      // the coordinator's own words tell it
};

/// Weights of the prior: what the moves do not show stays as in units.csv. An axis that does not
/// move tells nothing of its arm and its zero. Per mm^2 and degree^2.
inline StaticVector StaticPriorWeights(GeometryIs where, const bool (&moves)[2]) {
  constexpr double kBase_mm = 2, kArm_mm = 0.5, kZero_deg = 180;
  // Play of a base in its hole, scatter of arms and of zeros of a table in use; half and twice of
  // them change what few moves show.
  constexpr double kNearBase_mm = 0.1, kNearArm_mm = 0.06, kNearZero_deg = 1;
  constexpr double kFixed = 1e-6;
  // The median of a campaign's places tells a geometry so well.
  constexpr double kKnown_mm = 0.005, kKnown_deg = 0.05;
  const bool near = where != GeometryIs::kAnywhere;
  const bool known = where == GeometryIs::kKnown;
  StaticVector spread;
  spread.head<2>().setConstant(known ? kKnown_mm : near ? kNearBase_mm : kBase_mm);
  for (const std::size_t axis : {kTheta, kPhi}) {
    const auto a = static_cast<Eigen::Index>(axis);
    spread[2 + a] = moves[axis] ? (known ? kKnown_mm : near ? kNearArm_mm : kArm_mm) : kFixed;
    spread[4 + a] = moves[axis] ? (known ? kKnown_deg : near ? kNearZero_deg : kZero_deg) : kFixed;
  }
  return spread.array().square().inverse();
}

/// Whether an axis moves enough to tell its arm from its zero. Angles in degrees.
template <class Angles>
bool TellsOfItself(const Angles& angles_deg) {
  // A turn by this angle changes an arm of 3 mm by 0.5 um. Half or twice of it: the same axes.
  constexpr double kLeast_deg = 1;
  if (std::size(angles_deg) == 0) return false;
  const auto [low, high] = std::minmax_element(std::begin(angles_deg), std::end(angles_deg));
  return *high - *low >= kLeast_deg;
}

}  // namespace focalfleet::sim
