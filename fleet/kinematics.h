// Kinematics of a unit: from two axis angles to the place of the fibre, and back. With the zero
// angles added, a unit is a two-bar arm:
//
//   elbow = base  + arm_theta (cos T, sin T)            T = theta + theta_zero
//   fibre = elbow + arm_phi   (cos (T+P), sin (T+P))    P = phi + phi_zero
//
// The distance from base to fibre depends on P alone: r^2 = a^2 + b^2 + 2ab cos P. A point
// therefore has at most two values of P in a turn (elbow on either side), each with one direction
// T, each in whole turns as the ranges allow. Angles grow counter-clockwise seen from the sky side;
// P = 0 stretches the arm, 180 folds it back.
#pragma once

#include <optional>
#include <vector>

#include "fleet/drive.h"
#include "fleet/geometry/segment.h"
#include "fleet/layout.h"

namespace focalfleet {

/// Angles of both axes as the axes count them: whole turns included, zero angles not added.
struct AxisAngles {
  double theta_deg = 0;
  double phi_deg = 0;
};

/// The phi arm, the part that can touch: `a` is the elbow, `b` the fibre.
SegmentFp ArmAt(const Unit& unit, const AxisAngles& angles);
/// The place of the fibre.
PointFp FibreAt(const Unit& unit, const AxisAngles& angles);

AxisAngles AnglesOf(const Unit& unit, const UnitDrive& drive, const Pose& pose);
SegmentFp ArmAt(const Unit& unit, const UnitDrive& drive, const Pose& pose);
PointFp FibreAt(const Unit& unit, const UnitDrive& drive, const Pose& pose);

/// The whole vectors within the axis' range. Empty (low > high) only for a range below one vector.
struct VectorRange {
  std::int32_t low = 0;
  std::int32_t high = 0;
  [[nodiscard]] constexpr bool contains(std::int32_t vectors) const {
    return vectors >= low && vectors <= high;
  }
};
VectorRange RangeOf(const AxisGeometry& axis, const AxisDrive& drive);
/// The whole vector nearest to the angle that lies within the range.
std::int32_t NearestInRange(double angle_deg, const AxisGeometry& axis, const AxisDrive& drive);
bool InRange(const Unit& unit, const UnitDrive& drive, const Pose& pose);

/// A point this far out of reach is reached, at the border: coordinates in files are rounded.
/// Units: mm.
inline constexpr double kReachToleranceMm = 1e-3;

/// Distances from the base that the fibre can have within the range of phi. Units that cannot fold
/// all the way have a hole in the middle.
struct PatrolLimits {
  double min_mm = 0;
  double max_mm = 0;
};
PatrolLimits PatrolOf(const Unit& unit);

/// Every pair of angles within the ranges that puts the fibre on the point, ordered by phi, then
/// theta. The pairs are of both sides of the elbow and of all whole turns. Where the fibre stands
/// over the base every theta is possible, and `free_theta_deg`, brought into range, is taken.
/// Empty: out of patrol or out of range. Accuracy: at most kReachToleranceMm from the point. Cost:
/// O(solutions).
std::vector<AxisAngles> AnglesFor(const Unit& unit, PointFp fibre_fp, double free_theta_deg = 0);

/// The uncertainty of a measured fibre, and that of the believed pose.
struct SeenWith {
  double sigma_mm = 0.003;  // of one coordinate
  double believed_deg = 3;  // standard deviation of the belief about each axis
  double out_of_reach_mm = 0.25;
};
/// The most likely pose, in whole vectors, of a unit whose fibre was seen at a point:
///   argmin |FibreAt(q) - seen|^2 / sigma^2 + |q - believed|^2 / believed_deg^2,
/// elbow side and whole turns as believed. The belief decides where the point cannot: at the ends
/// of the reach an error of theta can hide an error of phi. The pose is not held to the ranges,
/// because a unit may stand outside of them. Empty: farther out of reach than that.
std::optional<Pose> PlaceSeen(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                              const Pose& believed, const SeenWith& with = {});

/// The angle plus every whole number of turns that lies within the axis' range, ascending.
std::vector<double> TurnsInRange(double angle_deg, const AxisGeometry& axis);

}  // namespace focalfleet
