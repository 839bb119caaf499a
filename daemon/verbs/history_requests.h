// The requests about the past: configurations and alarms, the moves of a unit, and the events of
// all of them in the order of time.
#pragma once

#include <functional>

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/store/store_reader.h"

namespace focalfleet {

/// Opens the store's reader with the first question that needs it.
using OpenReader = std::function<Result<StoreReader*>()>;

/// The period of {since_ns?, until_ns?}; without them all times. Errors: kInvalid.
Result<Period> PeriodArgument(const Json& args);
/// The least severity that is asked for: {severity?}. Errors: kInvalid.
Result<Severity> SeverityArgumentOr(const Json& args, Severity otherwise);

/// The answer to `history`. Arguments: {unit_id?, limit?, since_ns?, until_ns?, state?}. A state is
/// that of a configuration, or with a unit the end of a move. Errors: kInvalid; those of the store.
Result<Json> AskHistory(const ControlRequest& request, const FleetView& view,
                        const OpenReader& reader);

/// The answer to `events`: the newest of a period, the oldest first. Arguments: {since_ns?,
/// until_ns?, unit_ids?, severity?, limit?}. Errors: kInvalid; those of the store.
Result<Json> AskEvents(const ControlRequest& request, const FleetView& view,
                       const OpenReader& reader);

}  // namespace focalfleet
