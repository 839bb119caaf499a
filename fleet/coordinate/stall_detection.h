// Stall detection notices in time that a unit has ended by itself, while others are to pass where
// it may stand.
//
// A moving unit with followers is asked every `poll`. Where a question stays open for `suspicion`,
// repeats included, the followers of the unit are stopped as a precaution, though it may only be
// slow. From its end to the stop it takes at most poll + suspicion, when it ends right after an
// answer. A quarter of the notice is left for the host, the bus, and one repeat of the stop itself.
//
// The notice is longer than asked for where a repeat of the question would not fit into the
// suspicion. Plans are made with the longer one. The notice grows up to 5 s, beyond which plans
// would lose more than they gain. A fleet that waits longer than half a second for an answer gets
// no promise.
//
// With 1 s, two frames of at most 80 and 160 us pass every 400 ms for each watched unit. A bus of
// 100 units of which every one is watched carries 6 % for it.
#pragma once

#include <algorithm>

#include "fleet/coordinate/coordinator_config.h"

namespace focalfleet {

struct StallDetection {
  DurationNs notice;
  DurationNs poll;
  DurationNs suspicion;
};

constexpr StallDetection StallDetectionOf(const CoordinatorConfig& config) {
  // The question, and once more with twice the patience (Requests::Release).
  const std::int64_t suspicion_least = 3 * config.reply_wait.ns + 2 * config.transmit_horizon.ns;
  const std::int64_t achievable = std::min(suspicion_least * 100 / 35, Milliseconds(5000).ns);
  const std::int64_t notice = std::max(config.notice.ns, achievable);
  return {{notice}, {notice * 40 / 100}, {std::max(notice * 35 / 100, suspicion_least)}};
}
static_assert(StallDetectionOf({}).notice == CoordinatorConfig{}.notice, "the default can be kept");

}  // namespace focalfleet
