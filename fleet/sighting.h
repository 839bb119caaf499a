// What the camera over the plate found of one unit in one exposure, as the coordinator takes it.
// Only `kMeasured` and `kDidNotMove` put the unit somewhere; all else says why it is not known, and
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
  kMissing,     // no spot where it may stand
  kMeasured,    // one spot, and no other unit's
  kDidNotMove,  // measured where it stood before it was sent away
  kAmbiguous,   // more than one spot, or one that may be another unit's
  kSwapped,     // its spot is where another unit was sent: the two are confused somewhere
  kOutOfReach,  // its spot is where its arms cannot put it
};
inline constexpr std::uint8_t kSightingStatusCount = 6;
constexpr const char* Name(SightingStatus status) {
  constexpr const char* kNames[] = {"missing",   "measured", "did_not_move",
                                    "ambiguous", "swapped",  "out_of_reach"};
  return kNames[static_cast<std::size_t>(status)];
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

/// All of one exposure: one sighting a unit that was looked for.
struct Exposure {
  std::uint64_t id = 0;
  std::vector<Sighting> sightings;
};

}  // namespace focalfleet
