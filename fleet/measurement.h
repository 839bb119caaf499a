// What the camera over the plate found of one unit in one exposure, as the coordinator takes it.
// Only certain statuses (IsCertain) put the unit somewhere; all else says why it is not known, and
// what is known of the unit stays as it was.
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
  kMeasured,        // seen where its move ends
  kDidNotMove,      // told to move, and one axis or both are where they were
  kSwapped,         // it carried out another unit's command, and that one (or a ring) its own
  kStrayed,         // only spot in its patrol area that nobody else explains; its by elimination
  kSwapSuspected,   // strayed, to where the command of one other that is not seen would have led
  kBlended,         // its light is in this spot, but not alone: the place is biased
  kOutsidePatrol,   // the only spot left is where its arms do not reach
  kAmbiguous,       // more than one answer; no place is given
  kMissing,         // no spot that could be its
  kSensorsDoubted,  // what its own sensors say is not to be believed; its FibreCarrierReading says
                    // why
  kTooCoarse,       // its own sensors are less exact than what was asked for
};
const char* Name(MeasurementStatus status);
inline constexpr std::size_t kMeasurementStatusCount = 11;

/// The spot is this unit's, and nothing else is in it: the place may be used.
constexpr bool IsCertain(MeasurementStatus status) {
  return status == MeasurementStatus::kMeasured || status == MeasurementStatus::kDidNotMove ||
         status == MeasurementStatus::kSwapped;
}

/// Symmetric. Units: mm^2. Frame: focal plane.
struct CovarianceFp {
  double xx = 0;
  double xy = 0;
  double yy = 0;
  constexpr bool operator==(const CovarianceFp&) const = default;
};
/// The same in all directions. Units: um, of one coordinate.
constexpr CovarianceFp RoundCovariance(double sigma_um) {
  return {1e-6 * sigma_um * sigma_um, 0, 1e-6 * sigma_um * sigma_um};
}
/// Root mean square over directions of one coordinate's standard deviation. Units: um.
inline double SigmaUm(const CovarianceFp& covariance) {
  return 1e3 * std::sqrt((covariance.xx + covariance.yy) / 2);
}

/// Who saw it.
enum class MeasurementSource : std::uint8_t { kCamera, kSensors };
constexpr const char* Name(MeasurementSource source) {
  return source == MeasurementSource::kCamera ? "camera" : "hall_sensors";
}

/// What a unit's sensors showed, as they came over the bus.
struct SensorReading {
  std::uint8_t sensors = 0;  // 0: none
  std::array<std::uint16_t, limits::kSensorsPerUnit> counts{};
};

/// What was made of it: the orientation of its joint, alpha about x, then beta about y, then gamma
/// about the fibre carrier itself.
struct FibreCarrierReading {
  std::array<double, 3> angles_deg{};
  std::array<double, 6> covariance_deg2{};  // aa, ab, ag, bb, bg, gg
  std::uint16_t used = 0;                   // bit k: sensor k took part
  bool solved = false;                      // else the numbers mean nothing
  bool trusted = false;                     // and nothing speaks against it
  std::string verdict;  // "ok"; "missing v3"; "swapped v1 v6"; "cannot tell" ...
  bool operator==(const FibreCarrierReading&) const = default;
};

struct Measurement {
  PositionerIndex unit;
  MeasurementStatus status = MeasurementStatus::kMissing;
  MeasurementSource source = MeasurementSource::kCamera;
  std::optional<PositionerIndex> other;  // the unit that it is confused with
  // Where the status puts it somewhere, or a spot was found at all; focal-plane frame.
  double x_mm = 0;
  double y_mm = 0;
  CovarianceFp covariance;
  /// Both axes there, in whole vectors from each axis' zero, elbow side and turns as believed.
  std::optional<Pose> place;
  std::optional<FibreCarrierReading> carrier = {};  // of units with sensors, whoever is the source
};

/// What one exposure found: one measurement a unit that was looked for.
struct ExposureFindings {
  std::uint64_t id = 0;
  std::vector<Measurement> measurements;
  /// From when it was asked for until the shutter opened, by the host's clock; NaN: not known.
  double after_request_s = std::numeric_limits<double>::quiet_NaN();
  bool camera = true;               // an exposure was taken
  std::string camera_trouble = {};  // why one that was needed could not be used; the rest holds
};

}  // namespace focalfleet
