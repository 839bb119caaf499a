// The delivery of a fibre-view camera: spots of light, unidentified, with the exposure that they
// belong to. An exposure comes from outside (a file, a topic, a simulation) and is never trusted.
// First it is checked as a list of numbers (CheckSpots). Then it is checked as an exposure that may
// describe the present state of the fleet (Admit). Then its fiducials and fibres have to be where
// they can be (identify.h). Each check refuses the exposure as a whole, with the reason; nothing of
// it is used then.
//
// Frames: pixels of the sensor, the first pixel's centre at 0, 0.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

struct Spot {
  std::uint32_t id = 0;  // the detector's number, for messages
  double x_px = 0;
  double y_px = 0;
  double flux = 0;     // above the background, in units of the camera's own
  double fwhm_px = 0;  // 0: not measured
};

struct Exposure {
  std::string id;                  // the camera's name for it; used once only
  std::int64_t taken_unix_ns = 0;  // the shutter opens; nanoseconds since 1970 UTC
  std::vector<Spot> spots;
};

struct SensorLimits {
  double columns_px = 0;
  double rows_px = 0;
};

/// All spots are possible ones. Errors: kInvalid with the spot's id: a number that is not finite, a
/// place off the sensor, flux not above 0, a negative width, two spots with one id or at one place,
/// too many. Cost: O(n log n).
Status CheckSpots(const Exposure& exposure, const SensorLimits& sensor);

enum class RefusalReason : std::uint8_t {
  kDoubled,       // the exposure was there before, by its id or by its content
  kEarly,         // taken before the motion had ended
  kLate,          // too old
  kFuture,        // from a clock that is ahead
  kCount,         // far too many or too few spots for this plate
  kFewFiducials,  // not enough fiducials where they could be
  kTurned,        // the picture is turned by quarters of a turn
  kMirrored,      // the picture is mirrored (and perhaps turned)
  kScale,         // fiducials found, but at a scale out of bounds
  kRotation,      // ... rotated beyond bounds
  kShift,         // ... shifted beyond bounds
  kRough,         // ... scattered more than air does
  kOtherField,    // fiducials are in place, fibres are not: another field, or another plate
};
const char* Name(RefusalReason reason);

/// The reason why an exposure as a whole is not used.
struct Refusal {
  RefusalReason reason = RefusalReason::kCount;
  std::string text;  // one line for operators, with the numbers
};

/// A digest of the spots, equal for any order; ids of spots and the exposure's name do not count.
std::uint64_t ContentOf(const Exposure& exposure);

struct SeenExposure {
  std::string id;
  std::uint64_t content = 0;
};

struct AdmissionRules {
  std::int64_t motion_end_unix_ns = 0;  // the last unit came to rest
  std::int64_t now_unix_ns = 0;
  std::int64_t age_max_ns = 60'000'000'000;
  std::int64_t clock_slack_ns = 50'000'000;  // how far camera and host may differ
};

/// Empty: the exposure may describe the state after the motion. `seen`: earlier exposures, refused
/// ones included. Cost: O(n + seen).
std::optional<Refusal> Admit(const Exposure& exposure, const AdmissionRules& rules,
                             std::span<const SeenExposure> seen);

}  // namespace focalfleet
