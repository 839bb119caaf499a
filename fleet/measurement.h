// A measurement is the result of one exposure for one unit, by the camera over the plate or by the
// unit's own sensors. Only certain statuses (IsCertain) give the unit a place. All others are the
// reason why its place is not known, and the knowledge of the unit stays as it was.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"
#include "protocol/base/ids.h"
#include "protocol/base/limits.h"

namespace focalfleet {

enum class MeasurementStatus : std::uint8_t {
  kMeasured,    // seen where its move ends
  kDidNotMove,  // commanded to move, and one axis or both are where they were
  kSwapped,     // it carried out another unit's command, and that one (or a ring) its own
  kStrayed,     // the only spot in its patrol area that no other unit explains; its by elimination
  /// strayed, to where the command of one other unit that is not seen would have led
  kSwapSuspected,
  kBlended,         // its light is in this spot, but not alone: the place is biased
  kOutsidePatrol,   // the only spot left is where its arms do not reach
  kAmbiguous,       // more than one answer; no place is given
  kMissing,         // no spot that could be its
  kSensorsDoubted,  // its own sensors' reading cannot be trusted; its FibreCarrierReading has the
                    // reason
  kTooCoarse,       // its own sensors are less exact than the request
};
const char* Name(MeasurementStatus status);
inline constexpr std::size_t kMeasurementStatusCount = 11;

/// The spot is this unit's, and no other light is in it: the place may be used.
constexpr bool IsCertain(MeasurementStatus status) {
  return status == MeasurementStatus::kMeasured || status == MeasurementStatus::kDidNotMove ||
         status == MeasurementStatus::kSwapped;
}

/// The status says how far the unit is from where it was sent. A swapped unit's place is certain,
/// too, but not the way by which another's commands led there.
constexpr bool IsPut(MeasurementStatus status) {
  return IsCertain(status) && status != MeasurementStatus::kSwapped;
}

/// A symmetric matrix. Units: mm^2. Frame: focal plane.
struct CovarianceFp {
  double xx = 0;
  double xy = 0;
  double yy = 0;
  constexpr bool operator==(const CovarianceFp&) const = default;
};
/// The covariance that is the same in all directions. Units: um, of one coordinate.
constexpr CovarianceFp RoundCovariance(double sigma_um) {
  return {1e-6 * sigma_um * sigma_um, 0, 1e-6 * sigma_um * sigma_um};
}
/// Root mean square over directions of one coordinate's standard deviation. Units: um.
inline double SigmaUm(const CovarianceFp& covariance) {
  return 1e3 * std::sqrt((covariance.xx + covariance.yy) / 2);
}

/// The source of a measurement.
enum class MeasurementSource : std::uint8_t { kCamera, kSensors };
constexpr const char* Name(MeasurementSource source) {
  return source == MeasurementSource::kCamera ? "camera" : "hall_sensors";
}

/// The values of a unit's sensors, as they came over the bus.
struct SensorReading {
  std::uint8_t sensors = 0;  // 0: none
  std::array<std::uint16_t, limits::kSensorsPerUnit> counts{};
};

/// The result of a reading: the orientation of its joint, alpha about x, then beta about y, then
/// gamma about the fibre carrier itself.
struct FibreCarrierReading {
  std::array<double, 3> angles_deg{};
  std::array<double, 6> covariance_deg2{};  // aa, ab, ag, bb, bg, gg
  std::uint16_t used = 0;                   // bit k: sensor k took part
  bool solved = false;                      // otherwise the numbers mean nothing
  bool trusted = false;                     // and no check contradicts it
  std::string verdict;  // "ok"; "missing v3"; "swapped v1 v6"; "cannot tell" ...
  bool operator==(const FibreCarrierReading&) const = default;
};

struct Measurement {
  PositionerIndex unit;
  MeasurementStatus status = MeasurementStatus::kMissing;
  MeasurementSource source = MeasurementSource::kCamera;
  std::optional<PositionerIndex> other;  // the unit that it is confused with
  // The place by the status, or of any spot that was found; focal-plane frame.
  double x_mm = 0;
  double y_mm = 0;
  CovarianceFp covariance;
  /// Both axes at that place, in whole vectors from each axis' zero, elbow side and turns as
  /// believed.
  std::optional<Pose> place;
  std::optional<FibreCarrierReading> carrier = {};  // of units with sensors, whatever the source
};

/// The findings of one exposure: one measurement for each unit that was looked for.
struct ExposureFindings {
  std::uint64_t id = 0;
  std::vector<Measurement> measurements;
  /// From the request until the shutter opened, by the host's clock; NaN: not known.
  double after_request_s = std::numeric_limits<double>::quiet_NaN();
  bool camera = true;               // an exposure was taken
  std::string camera_trouble = {};  // why a needed exposure could not be used; the rest holds
};

}  // namespace focalfleet
