#include "fleet/camera/findings.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "fleet/camera/claims.h"
#include "fleet/kinematics.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

// Errors of units in service (sim/world/spread.h): the zero angles are off by 0.5 degrees, arms by
// 57 um. Once a camera has measured a unit, scale (0.3 % of a move), periodic error and the arms
// remain.
constexpr BlindError kNeverSeen{
    .theta_sigma_deg = 0.7, .phi_sigma_deg = 0.7, .place_sigma_mm = 0.06};
constexpr BlindError kSeen{.theta_sigma_deg = 0.35, .phi_sigma_deg = 0.35, .place_sigma_mm = 0.04};
const BlindError& BlindOf(bool seen) { return seen ? kSeen : kNeverSeen; }
constexpr double kMeasuredSigmaMm = 0.005;  // of a unit that rests where a camera saw it

bool IsMeasured(const UnitKnowledge& knowledge) {
  return knowledge[0].witness == Witness::kMeasured && knowledge[1].witness == Witness::kMeasured;
}

/// The angle by which zero angles and arms may put a unit of unknown place outside of its interval.
constexpr double kBoxSlackDeg = 3;

/// The angles of an interval of vectors. Empty: one axis at least is unknown.
std::optional<AngleBox> BoxOf(const Unit& unit, const UnitDrive& drive,
                              const UnitKnowledge& knowledge) {
  AngleBox box;
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    if (knowledge[a].witness == Witness::kUnknown) return std::nullopt;
    box.axis[a] = {AngleDeg(knowledge[a].low, unit.axis[a], drive.axis[a]) - kBoxSlackDeg,
                   AngleDeg(knowledge[a].high, unit.axis[a], drive.axis[a]) + kBoxSlackDeg};
  }
  return box;
}

/// The pose after the exposure: an axis that stayed is believed where it was.
Pose BelievedPose(const UnitMeasurement& seen, const Pose& now, const std::optional<Pose>& before) {
  Pose pose = now;
  if (seen.status == MeasurementStatus::kDidNotMove && before)
    for (const Axis axis : kAxes)
      if (seen.stayed[Index(axis)]) pose[Index(axis)] = (*before)[Index(axis)];
  return pose;
}

}  // namespace

std::vector<UnitExpectation> Expect(const Layout& layout, const Believed& believed) {
  FOCALFLEET_CHECK(
      believed.now.size() == layout.size() && believed.before.size() == layout.size() &&
      believed.seen.size() == layout.size() && believed.drives.size() == layout.size());
  std::vector<UnitExpectation> all(layout.size());
  for (std::size_t n = 0; n < layout.size(); ++n) {
    const Unit& unit = layout.units()[n];
    if (!IsPlace(believed.now[n])) {
      std::optional<AxisAngles> says;
      if (!believed.reported.empty() && believed.reported[n])
        says = AnglesOf(unit, believed.drives[n], *believed.reported[n]);
      all[n] = ExpectLost(unit, says, BoxOf(unit, believed.drives[n], believed.now[n]), kNeverSeen);
      continue;
    }
    const Pose place = PlaceOf(believed.now[n]);
    if (IsMeasured(believed.now[n])) {
      all[n] = ExpectStill(FibreAt(unit, believed.drives[n], place), kMeasuredSigmaMm);
      continue;
    }
    const AxisAngles commanded = AnglesOf(unit, believed.drives[n], place);
    all[n] = ExpectMove(
        unit,
        believed.before[n] ? AnglesOf(unit, believed.drives[n], *believed.before[n]) : commanded,
        commanded, BlindOf(believed.seen[n] != 0));
    // The place of this unit is only reported: it is no light of known place for the camera.
    all[n].moved = true;
  }
  return all;
}

namespace {

/// Standard deviations of the spot that may move the elbow by the clearance: one lost unit of
/// 16,000 is taken for known too early. With two it would be one of 20; with eight, twice as large
/// a circle around the base has to be homed.
constexpr double kElbowSigmas = 4;

/// An error of the spot turns theta, and with it the elbow: without bound where the arm is folded,
/// by its root where the arm is stretched.
bool IsElbowKnown(const Unit& unit, PointFp at_fp, double sigma_mm, double clearance_mm) {
  using namespace std::complex_literals;
  const auto elbow_at = [&unit](const AxisAngles& angles) {
    return std::polar(unit.theta().arm_mm,
                      (angles.theta_deg + unit.theta().zero_deg) * std::numbers::pi / 180);
  };
  const std::complex<double> fibre{at_fp.x_mm, at_fp.y_mm};
  const std::complex<double> from_base = fibre - std::complex(unit.base_fp.x_mm, unit.base_fp.y_mm);
  const double distance_mm = std::abs(from_base);
  const std::complex<double> along = distance_mm > 0 ? from_base / distance_mm : 1.0;
  const std::vector<AxisAngles> here = AnglesFor(unit, at_fp);
  for (const std::complex<double> turn : {1.0 + 0i, -1.0 + 0i, 0.0 + 1i, 0.0 - 1i}) {
    const std::complex<double> there = fibre + kElbowSigmas * sigma_mm * along * turn;
    const auto there_fp = InReach(unit, {there.real(), there.imag()}, kStraySlackMm);
    if (!there_fp) return false;
    for (const AxisAngles& angles : here) {
      double apart_mm = std::numeric_limits<double>::infinity();
      for (const AxisAngles& other : AnglesFor(unit, *there_fp))
        apart_mm = std::min(apart_mm, std::abs(elbow_at(angles) - elbow_at(other)));
      if (apart_mm > clearance_mm) return false;
    }
  }
  return true;
}

}  // namespace

std::optional<Pose> PoseOfLost(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                               const UnitExpectation& expectation, double sigma_mm,
                               double clearance_mm) {
  const auto at_fp = InReach(unit, seen_fp, kStraySlackMm);
  if (!at_fp) return std::nullopt;
  if (!IsElbowKnown(unit, *at_fp, sigma_mm, clearance_mm)) return std::nullopt;
  std::vector<AxisAngles> possible = AnglesFor(unit, *at_fp);
  if (expectation.within)
    std::erase_if(possible,
                  [&](const AxisAngles& angles) { return !expectation.within->Holds(angles); });
  if (possible.size() > 1 && expectation.commanded)
    std::erase_if(possible, [&](const AxisAngles& angles) {
      return std::abs(angles.theta_deg - expectation.commanded->theta_deg) > kBoxSlackDeg ||
             std::abs(angles.phi_deg - expectation.commanded->phi_deg) > kBoxSlackDeg;
    });
  if (possible.size() != 1) return std::nullopt;
  const Pose pose{NearestVectors(possible[0].theta_deg, unit.axis[0], drive.axis[0]),
                  NearestVectors(possible[0].phi_deg, unit.axis[1], drive.axis[1])};
  return PlaceSeen(unit, drive, seen_fp, pose, {.sigma_mm = sigma_mm});
}

std::optional<Pose> PoseOfKnown(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                                const Pose& believed, const KnownSeen& with) {
  SeenWith seen_with{.sigma_mm = with.sigma_mm};
  const double turn_rad =
      kElbowSigmas * with.sigma_mm /
      std::hypot(seen_fp.x_mm - unit.base_fp.x_mm, seen_fp.y_mm - unit.base_fp.y_mm);
  if (!(turn_rad * unit.theta().arm_mm < with.clearance_mm))
    seen_with.believed_deg = BlindOf(with.was_seen).theta_sigma_deg;
  return PlaceSeen(unit, drive, seen_fp, believed, seen_with);
}

Result<ExposureFindings> FindUnits(std::uint64_t id, const Layout& layout, const Believed& believed,
                                   const CameraSite& site, const Exposure& exposure) {
  const std::vector<UnitExpectation> expectations = Expect(layout, believed);
  const auto identified = Identify({.layout = &layout,
                                    .expectations = expectations,
                                    .fiducials = site.fiducials,
                                    .camera = &site.model,
                                    .exposure = &exposure},
                                   site.options);
  if (!identified)
    return Fail(ErrorCode::kRefused,
                std::string(Name(identified.error().reason)) + ": " + identified.error().text);
  ExposureFindings findings{.id = id, .measurements = {}};
  findings.measurements.reserve(layout.size());
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const UnitMeasurement& seen = identified->units[n];
    Measurement measurement{.unit = {n}, .status = seen.status, .other = {}, .place = {}};
    if (seen.other != kNoUnit) measurement.other = seen.other;
    if (seen.spot != kNoSpot) {
      measurement.x_mm = seen.at_fp.x_mm;
      measurement.y_mm = seen.at_fp.y_mm;
      const double sigma_mm = std::sqrt((seen.covariance.xx + seen.covariance.yy) / 2);
      measurement.covariance = seen.covariance;
      if (IsCertain(seen.status) && expectations[n].lost)
        measurement.place = PoseOfLost(layout.units()[n], believed.drives[n], seen.at_fp,
                                       expectations[n], sigma_mm, layout.clearance_mm());
      else if (IsCertain(seen.status))
        measurement.place =
            PoseOfKnown(layout.units()[n], believed.drives[n], seen.at_fp,
                        BelievedPose(seen, PlaceOf(believed.now[n]), believed.before[n]),
                        {.sigma_mm = sigma_mm,
                         .clearance_mm = layout.clearance_mm(),
                         .was_seen = believed.seen[n] != 0});
    }
    findings.measurements.push_back(std::move(measurement));
  }
  return findings;
}

}  // namespace focalfleet
