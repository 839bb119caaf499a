// Two things on the plate are clear of each other when the distance of their cores is large enough.
// The limit is the sum of their half-widths (or radius) and the configured clearance. `extra_mm`
// asks for more than that, to leave room for what a caller rounds or bounds.
#pragma once

#include "fleet/geometry/segment.h"
#include "fleet/layout.h"

namespace focalfleet {

/// Core distance at which the arms of two units are just clear. Units: mm.
inline double ClearDistanceMm(const Layout& layout, PositionerIndex i, PositionerIndex j) {
  return layout.unit(i).arm_half_width_mm + layout.unit(j).arm_half_width_mm +
         layout.clearance_mm();
}
inline double ClearDistanceMm(const Layout& layout, PositionerIndex i, const Obstacle& obstacle) {
  return layout.unit(i).arm_half_width_mm + obstacle.radius_mm + layout.clearance_mm();
}

struct ArmOf {
  PositionerIndex unit;
  SegmentFp arm_fp;
};

inline bool IsClear(const Layout& layout, const ArmOf& a, const ArmOf& b, double extra_mm) {
  const double needed = ClearDistanceMm(layout, a.unit, b.unit) + extra_mm;
  return SquaredDistance(a.arm_fp, b.arm_fp) > needed * needed;
}
inline bool IsClear(const Layout& layout, const ArmOf& a, const Obstacle& obstacle,
                    double extra_mm) {
  const double needed = ClearDistanceMm(layout, a.unit, obstacle) + extra_mm;
  return SquaredDistance(obstacle.centre_fp, a.arm_fp) > needed * needed;
}

}  // namespace focalfleet
