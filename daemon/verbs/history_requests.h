// The requests about the past: configurations and alarms, the moves, parameters and measurements of
// units, and the events of all of them in the order of time.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/verbs/store_questions.h"

namespace focalfleet {

/// The period of {since_ns?, until_ns?}; without them all times. Errors: kInvalid.
Result<Period> PeriodArgument(const Json& args);
/// The least severity that is asked for: {severity?}. Errors: kInvalid.
Result<Severity> SeverityArgumentOr(const Json& args, Severity otherwise);

/// The answer to `history`. Arguments: {unit_id?, limit?, since_ns?, until_ns?, state?}. A state is
/// that of a configuration, or with a unit the end of a move. Errors: kInvalid; those of the store.
Result<StoreReading> AskHistory(const ControlRequest& request, const FleetView& view);

/// The answer to `events`: {events, next, more}, the oldest first. Arguments: {since_ns?,
/// until_ns?, unit_ids?, severity?, limit?} for the newest of a period, or {after, unit_ids?,
/// severity?} for the oldest after `next` of an earlier answer. With `more` there are further ones
/// after `next`. Nothing is left out from one page to the next: entries are counted by their
/// numbers in the store, not by the clock. Errors: kInvalid; those of the store.
Result<StoreReading> AskEvents(const ControlRequest& request, const FleetView& view);

/// The answer to `params` {unit_id}: what the unit's hardware was set to, and how it was tuned.
/// Errors: kInvalid; those of the store.
Result<StoreReading> AskParameters(const ControlRequest& request, const FleetView& view);

/// The answer to `measurements` {exposure?}: without it, those of the newest exposure of the last
/// configuration. Errors: kInvalid; kRefused: there is none; those of the store.
Result<StoreReading> AskMeasurements(const ControlRequest& request, const FleetView& view);

}  // namespace focalfleet
