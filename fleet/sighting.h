// What the camera over the plate found of one unit in one exposure, as the coordinator takes it.
// Only certain statuses (IsCertain) put the unit somewhere; all else says why it is not known, and
// what is known of the unit stays as it was.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"
#include "protocol/base/ids.h"

namespace focalfleet {

enum class SightingStatus : std::uint8_t {
  kMeasured,       // seen where its move ends
  kDidNotMove,     // told to move, and one axis or both are where they were
  kSwapped,        // it carried out another unit's command, and that one (or a ring) its own
  kStrayed,        // only spot in its patrol area that nobody else explains; its by elimination
  kSwapSuspected,  // strayed, to where the command of one other that is not seen would have led
  kBlended,        // its light is in this spot, but not alone: the place is biased
  kOutsidePatrol,  // the only spot left is where its arms do not reach
  kAmbiguous,      // more than one answer; no place is given
  kMissing,        // no spot that could be its
};
const char* Name(SightingStatus status);
inline constexpr std::size_t kSightingStatusCount = 9;

/// The spot is this unit's, and nothing else is in it: the place may be used.
constexpr bool IsCertain(SightingStatus status) {
  return status == SightingStatus::kMeasured || status == SightingStatus::kDidNotMove ||
         status == SightingStatus::kSwapped;
}

struct Sighting {
  PositionerIndex unit;
  SightingStatus status = SightingStatus::kMissing;
  std::optional<PositionerIndex> other;  // the unit that it is confused with
  // Where the status puts it somewhere, or a spot was found at all; focal-plane frame.
  double x_mm = 0;
  double y_mm = 0;
  double sigma_um = 0;  // of one coordinate
  /// Both axes there, in whole vectors from each axis' zero, elbow side and turns as believed.
  std::optional<Pose> place;
};

/// What one exposure found: one sighting a unit that was looked for.
struct ExposureFindings {
  std::uint64_t id = 0;
  std::vector<Sighting> sightings;
};

}  // namespace focalfleet
