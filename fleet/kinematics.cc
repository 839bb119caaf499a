#include "fleet/kinematics.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"

namespace focalfleet {
namespace {

// Rounding of a table's last digit at the end of a range must not cost a solution.
constexpr double kRangeToleranceDeg = 1e-6;
constexpr double kVectorToleranceDeg = 1e-9;  // rounding of a range that ends at a whole vector
// Near stretched and folded the distance hardly depends on phi. A point within the reach tolerance
// may then ask for a phi this far outside the range. The phi is clamped and tried against the
// tolerance itself. Units: degrees.
constexpr double kClampTryDeg = 3;

std::vector<double> TurnsWithin(double angle_deg, const AxisGeometry& axis, double tolerance_deg) {
  std::vector<double> turns;
  // The remainder is exact, and near 0 a turn more is another number, whatever the angle was.
  angle_deg = std::remainder(angle_deg, 360);
  const double first = std::ceil((axis.min_deg - tolerance_deg - angle_deg) / 360);
  for (double k = first; angle_deg + 360 * k <= axis.max_deg + tolerance_deg; ++k)
    turns.push_back(std::clamp(angle_deg + 360 * k, axis.min_deg, axis.max_deg));
  return turns;
}

PointFp Moved(PointFp from, double length_mm, double direction_deg) {
  return {from.x_mm + length_mm * std::cos(direction_deg * kRadiansPerDegree),
          from.y_mm + length_mm * std::sin(direction_deg * kRadiansPerDegree)};
}

double DistanceAt(const Unit& unit, double phi_deg) {
  const double a = unit.theta().arm_mm;
  const double b = unit.phi().arm_mm;
  const double c = std::cos((phi_deg + unit.phi().zero_deg) * kRadiansPerDegree);
  return std::sqrt(std::max(0.0, a * a + b * b + 2 * a * b * c));
}

// The theta that points the fibre at a direction, for a given phi; without whole turns.
double ThetaFor(const Unit& unit, double direction_deg, double phi_deg) {
  const double p = (phi_deg + unit.phi().zero_deg) * kRadiansPerDegree;
  const double lead = std::atan2(unit.phi().arm_mm * std::sin(p),
                                 unit.theta().arm_mm + unit.phi().arm_mm * std::cos(p));
  return direction_deg - lead / kRadiansPerDegree - unit.theta().zero_deg;
}

bool SamePlace(const AxisAngles& a, const AxisAngles& b) {
  return std::abs(a.theta_deg - b.theta_deg) < kRangeToleranceDeg &&
         std::abs(a.phi_deg - b.phi_deg) < kRangeToleranceDeg;
}

// Both signs of phi + phi_zero that give the distance, as the axis counts, whole turns included.
std::vector<double> PhisFor(const Unit& unit, double distance_mm) {
  const double a = unit.theta().arm_mm;
  const double b = unit.phi().arm_mm;
  const double c = (distance_mm * distance_mm - a * a - b * b) / (2 * a * b);
  const double bend_deg = std::acos(std::clamp(c, -1.0, 1.0)) / kRadiansPerDegree;
  std::vector<double> phis = TurnsWithin(bend_deg - unit.phi().zero_deg, unit.phi(), kClampTryDeg);
  for (const double phi : TurnsWithin(-bend_deg - unit.phi().zero_deg, unit.phi(), kClampTryDeg))
    phis.push_back(phi);
  return phis;
}

}  // namespace

SegmentFp ArmAt(const Unit& unit, const AxisAngles& angles) {
  const double t = angles.theta_deg + unit.theta().zero_deg;
  const double p = angles.phi_deg + unit.phi().zero_deg;
  const PointFp elbow = Moved(unit.base_fp, unit.theta().arm_mm, t);
  return {elbow, Moved(elbow, unit.phi().arm_mm, t + p)};
}

PointFp FibreAt(const Unit& unit, const AxisAngles& angles) { return ArmAt(unit, angles).b; }

AxisAngles AnglesOf(const Unit& unit, const UnitDrive& drive, const Pose& pose) {
  return {AngleDeg(pose[0], unit.axis[0], drive.axis[0]),
          AngleDeg(pose[1], unit.axis[1], drive.axis[1])};
}

SegmentFp ArmAt(const Unit& unit, const UnitDrive& drive, const Pose& pose) {
  return ArmAt(unit, AnglesOf(unit, drive, pose));
}

PointFp FibreAt(const Unit& unit, const UnitDrive& drive, const Pose& pose) {
  return ArmAt(unit, drive, pose).b;
}

VectorRange RangeOf(const AxisGeometry& axis, const AxisDrive& drive) {
  const double step = DegreesPerVector(axis, drive);
  return {static_cast<std::int32_t>(std::ceil((axis.min_deg - kVectorToleranceDeg) / step)),
          static_cast<std::int32_t>(std::floor((axis.max_deg + kVectorToleranceDeg) / step))};
}

std::int32_t NearestInRange(double angle_deg, const AxisGeometry& axis, const AxisDrive& drive) {
  const VectorRange range = RangeOf(axis, drive);
  const double inside = std::clamp(angle_deg, axis.min_deg, axis.max_deg);
  return std::clamp(NearestVectors(inside, axis, drive), range.low,
                    std::max(range.low, range.high));
}

bool InRange(const Unit& unit, const UnitDrive& drive, const Pose& pose) {
  return std::all_of(std::begin(kAxes), std::end(kAxes), [&](Axis axis) {
    const std::size_t k = Index(axis);
    return RangeOf(unit.axis[k], drive.axis[k]).contains(pose[k]);
  });
}

PatrolLimits PatrolOf(const Unit& unit) {
  // The distance falls from stretched to folded and rises again. Its extremes are therefore at the
  // ends of the range, or at the stretched and folded angles inside it.
  const AxisGeometry& phi = unit.phi();
  const double at_min = DistanceAt(unit, phi.min_deg);
  const double at_max = DistanceAt(unit, phi.max_deg);
  PatrolLimits limits{std::min(at_min, at_max), std::max(at_min, at_max)};
  for (const double bend_deg : {0.0, 180.0})
    for (const double inside : TurnsWithin(bend_deg - phi.zero_deg, phi, 0)) {
      limits.min_mm = std::min(limits.min_mm, DistanceAt(unit, inside));
      limits.max_mm = std::max(limits.max_mm, DistanceAt(unit, inside));
    }
  return limits;
}

std::vector<AxisAngles> AnglesFor(const Unit& unit, PointFp fibre_fp, double free_theta_deg) {
  std::vector<AxisAngles> solutions;
  const double distance = DistanceMm(unit.base_fp, fibre_fp);
  if (!std::isfinite(distance)) return solutions;
  const bool direction_is_free = distance < kReachToleranceMm / 2;
  const double direction_deg =
      std::atan2(fibre_fp.y_mm - unit.base_fp.y_mm, fibre_fp.x_mm - unit.base_fp.x_mm) /
      kRadiansPerDegree;
  for (const double phi : PhisFor(unit, distance)) {
    const double theta = ThetaFor(unit, direction_deg, phi);
    const std::vector<double> thetas =
        direction_is_free ? std::vector<double>{std::clamp(free_theta_deg, unit.theta().min_deg,
                                                           unit.theta().max_deg)}
                          : TurnsWithin(theta, unit.theta(), kClampTryDeg);
    for (const double turned : thetas) {
      const AxisAngles candidate{turned, phi};
      const bool reaches = DistanceMm(FibreAt(unit, candidate), fibre_fp) <= kReachToleranceMm;
      const bool known = std::any_of(solutions.begin(), solutions.end(),
                                     [&](const AxisAngles& s) { return SamePlace(s, candidate); });
      if (reaches && !known) solutions.push_back(candidate);
    }
  }
  std::sort(solutions.begin(), solutions.end(), [](const AxisAngles& a, const AxisAngles& b) {
    return a.phi_deg != b.phi_deg ? a.phi_deg < b.phi_deg : a.theta_deg < b.theta_deg;
  });
  return solutions;
}

namespace {

// Both angles from the point alone: on the elbow side and in the turns nearest to `believed`.
AxisAngles AnglesSeen(const Unit& unit, PointFp seen_fp, const AxisAngles& believed) {
  const double a = unit.theta().arm_mm;
  const double b = unit.phi().arm_mm;
  const double distance = DistanceMm(unit.base_fp, seen_fp);
  const double c = (distance * distance - a * a - b * b) / (2 * a * b);
  const double bend_deg = std::acos(std::clamp(c, -1.0, 1.0)) / kRadiansPerDegree;
  const auto nearest = [](double angle_deg, double to_deg) {
    return to_deg + std::remainder(angle_deg - to_deg, 360);
  };
  const double one = nearest(bend_deg - unit.phi().zero_deg, believed.phi_deg);
  const double other = nearest(-bend_deg - unit.phi().zero_deg, believed.phi_deg);
  const double phi =
      std::abs(one - believed.phi_deg) <= std::abs(other - believed.phi_deg) ? one : other;
  const double direction_deg =
      std::atan2(seen_fp.y_mm - unit.base_fp.y_mm, seen_fp.x_mm - unit.base_fp.x_mm) /
      kRadiansPerDegree;
  return {nearest(ThetaFor(unit, direction_deg, phi), believed.theta_deg), phi};
}

// A Gauss-Newton step of the minimisation in PlaceSeen. Units: mm and radians inside.
AxisAngles Improved(const Unit& unit, PointFp seen_fp, const AxisAngles& at,
                    const AxisAngles& believed, const SeenWith& with) {
  const SegmentFp arm = ArmAt(unit, at);
  // The fibre turns about the base with theta, about the elbow with phi.
  const double jt_x = -(arm.b.y_mm - unit.base_fp.y_mm), jt_y = arm.b.x_mm - unit.base_fp.x_mm;
  const double jp_x = -(arm.b.y_mm - arm.a.y_mm), jp_y = arm.b.x_mm - arm.a.x_mm;
  const double rx = seen_fp.x_mm - arm.b.x_mm, ry = seen_fp.y_mm - arm.b.y_mm;
  const double prior = with.sigma_mm / (with.believed_deg * kRadiansPerDegree);
  const double weight = prior * prior;
  const double tt = jt_x * jt_x + jt_y * jt_y + weight;
  const double pp = jp_x * jp_x + jp_y * jp_y + weight;
  const double tp = jt_x * jp_x + jt_y * jp_y;
  const double bt =
      jt_x * rx + jt_y * ry + weight * (believed.theta_deg - at.theta_deg) * kRadiansPerDegree;
  const double bp =
      jp_x * rx + jp_y * ry + weight * (believed.phi_deg - at.phi_deg) * kRadiansPerDegree;
  const double determinant = tt * pp - tp * tp;  // positive because of the prior
  return {at.theta_deg + (pp * bt - tp * bp) / determinant / kRadiansPerDegree,
          at.phi_deg + (tt * bp - tp * bt) / determinant / kRadiansPerDegree};
}

}  // namespace

std::optional<Pose> PlaceSeen(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                              const Pose& believed, const SeenWith& with) {
  const double distance = DistanceMm(unit.base_fp, seen_fp);
  const double a = unit.theta().arm_mm;
  const double b = unit.phi().arm_mm;
  if (!(distance <= a + b + with.out_of_reach_mm) ||
      distance < std::abs(a - b) - with.out_of_reach_mm)
    return std::nullopt;
  const AxisAngles prior = AnglesOf(unit, drive, believed);
  AxisAngles angles = AnglesSeen(unit, seen_fp, prior);
  /// convergence is quadratic so near; at the ends of the reach the prior decides
  constexpr int kSteps = 4;
  for (int step = 0; step < kSteps; ++step) angles = Improved(unit, seen_fp, angles, prior, with);
  return Pose{NearestVectors(angles.theta_deg, unit.axis[0], drive.axis[0]),
              NearestVectors(angles.phi_deg, unit.axis[1], drive.axis[1])};
}

std::vector<double> TurnsInRange(double angle_deg, const AxisGeometry& axis) {
  return TurnsWithin(angle_deg, axis, kRangeToleranceDeg);
}

}  // namespace focalfleet
