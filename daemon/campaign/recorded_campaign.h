// Campaigns that the daemon's store has by itself: every exposure of a configuration says where the
// units stood after their moves. The moves of one list (`campaign run` makes a configuration of
// each) are a campaign, and so are all configurations of a night, from noon to noon UTC.
//
// A row is a unit in the last exposure of a configuration: from where its last move began, to where
// it went. A unit that stayed has a row without a step. A unit whose move ended otherwise than by
// arriving has no row until it has arrived again, for nobody knows what it was commanded to.
// Angles are places as the coordinator had them: by the model that was in force, where there was
// one, and from measured places where the loop was closed. docs/files.md has the columns.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/store/store_reader.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet {

struct RecordedList {
  std::string name;
  bool is_night = false;    // else the moves of one list
  std::uint64_t first = 0;  // configurations
  std::uint64_t last = 0;
  std::size_t configurations = 0;
  WallTime began;  // the first of them
};

/// The lists of moves, then the nights, among the newest `configurations_max` configurations, the
/// newest first. Whether anything was measured is not looked up.
Result<std::vector<RecordedList>> RecordedLists(StoreReader* store,
                                                std::uint32_t configurations_max);

/// The rows of a night, or of the list's moves alone. Where there are more than `rows_max` the
/// oldest exposures are left out.
/// Errors: kRefused: none of these configurations was measured; also those of the reader.
Result<sim::Campaign> RecordedCampaign(StoreReader* store, const Layout& layout,
                                       const RecordedList& list, std::size_t rows_max);

}  // namespace focalfleet
