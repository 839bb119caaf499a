// The request `replay`: what a past configuration left, unit by unit, so that a page can show it
// once more. The rows of its plan are elsewhere (page/kept_plans.h), as long as they are kept.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/verbs/store_questions.h"

namespace focalfleet {

/// The moves of one answer are at most this many: some 400 kB, and 20 ms of the reader's thread.
inline constexpr std::uint32_t kReplayMovesMax = 4096;

/// The answer to `replay` {configuration, after?, limit?}: a page of its moves as columns, the
/// oldest first, and `next` for the page after it; null with the last. The first page also has the
/// configuration, the errors of its last exposure and the alarms of its time. Angles are directions
/// on the plate as /layout has it, by the drives of today. Moves of units that the layout no longer
/// has are counted. Errors: kInvalid; kRefused: there is no such configuration; those of the store.
Result<StoreReading> AskReplay(const ControlRequest& request, const FleetView& view);

}  // namespace focalfleet
