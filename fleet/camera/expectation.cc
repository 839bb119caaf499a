#include "fleet/camera/expectation.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"

namespace focalfleet {
namespace {

// Sides of the elbow nearer than this count as one: the arm is stretched or folded. Units: degrees.
constexpr double kSameElbowDeg = 1;

double Farther(const AxisAngles& a, const AxisAngles& b) {
  return std::max(std::abs(a.theta_deg - b.theta_deg), std::abs(a.phi_deg - b.phi_deg));
}

}  // namespace

CovarianceFp CovarianceAt(const Unit& unit, const AxisAngles& angles, const BlindError& blind) {
  const SegmentFp arm = ArmAt(unit, angles);
  const double tx = -(arm.b.y_mm - unit.base_fp.y_mm);
  const double ty = arm.b.x_mm - unit.base_fp.x_mm;
  const double px = -(arm.b.y_mm - arm.a.y_mm);
  const double py = arm.b.x_mm - arm.a.x_mm;
  const double t2 =
      blind.theta_sigma_deg * blind.theta_sigma_deg * kRadiansPerDegree * kRadiansPerDegree;
  const double p2 =
      blind.phi_sigma_deg * blind.phi_sigma_deg * kRadiansPerDegree * kRadiansPerDegree;
  const double s2 = blind.place_sigma_mm * blind.place_sigma_mm;
  return {t2 * tx * tx + p2 * px * px + s2, t2 * tx * ty + p2 * px * py,
          t2 * ty * ty + p2 * py * py + s2};
}

double SquaredSigmas(PointFp from, PointFp to, const CovarianceFp& covariance, double sigma_mm) {
  const double dx = to.x_mm - from.x_mm;
  const double dy = to.y_mm - from.y_mm;
  const double xx = covariance.xx + sigma_mm * sigma_mm;
  const double yy = covariance.yy + sigma_mm * sigma_mm;
  const double determinant = xx * yy - covariance.xy * covariance.xy;
  return (yy * dx * dx - 2 * covariance.xy * dx * dy + xx * dy * dy) / determinant;
}

double LargestVariance(const CovarianceFp& covariance) {
  const double mean = (covariance.xx + covariance.yy) / 2;
  return mean + std::hypot((covariance.xx - covariance.yy) / 2, covariance.xy);
}

UnitExpectation ExpectMove(const Unit& unit, const AxisAngles& before, const AxisAngles& commanded,
                           const BlindError& blind) {
  UnitExpectation expectation;
  expectation.expected_fp = FibreAt(unit, commanded);
  expectation.commanded = commanded;
  expectation.before = before;
  expectation.before_fp = FibreAt(unit, before);
  expectation.moved =
      before.theta_deg != commanded.theta_deg || before.phi_deg != commanded.phi_deg;
  expectation.blind = blind;
  return expectation;
}

UnitExpectation ExpectStill(PointFp seen_fp, double sigma_mm) {
  UnitExpectation expectation;
  expectation.expected_fp = seen_fp;
  expectation.before_fp = seen_fp;
  expectation.before_sigma_mm = sigma_mm;
  expectation.moved = false;
  return expectation;
}

UnitExpectation ExpectLost(const Unit& unit, const std::optional<AxisAngles>& says,
                           const std::optional<AngleBox>& within, const BlindError& blind) {
  UnitExpectation expectation;
  expectation.lost = true;
  expectation.within = within;
  expectation.blind = blind;
  if (!says || (within && !within->Holds(*says))) return expectation;
  expectation.expected_fp = FibreAt(unit, *says);
  expectation.commanded = *says;
  return expectation;
}

PoseReading ReadPose(const Unit& unit, PointFp seen_fp, const AxisAngles& believed,
                     double travel_max_deg) {
  PoseReading reading;
  const std::vector<AxisAngles> all = AnglesFor(unit, seen_fp, believed.theta_deg);
  for (const AxisAngles& angles : all)
    if (!reading.nearest || Farther(angles, believed) < Farther(*reading.nearest, believed))
      reading.nearest = angles;
  if (!reading.nearest) return reading;
  reading.elbow_is_known = true;
  reading.turn_is_known = true;
  for (const AxisAngles& other : all) {
    if (Farther(other, believed) > travel_max_deg) continue;
    const bool same_elbow = std::abs(other.phi_deg - reading.nearest->phi_deg) < kSameElbowDeg;
    const double turned = std::abs(other.theta_deg - reading.nearest->theta_deg);
    if (!same_elbow) reading.elbow_is_known = false;
    if (same_elbow && turned > 180) reading.turn_is_known = false;
  }
  // The belief is so poor that even the nearest pose may be the wrong one.
  if (Farther(*reading.nearest, believed) > travel_max_deg) {
    reading.elbow_is_known = all.size() == 1;
    reading.turn_is_known = all.size() == 1;
  }
  return reading;
}

}  // namespace focalfleet
