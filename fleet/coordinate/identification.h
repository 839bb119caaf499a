// An identification reads a unit anew and settles what is known of it. Seven questions in a row ask
// for identity, status, two vectors, two carrier counts and the clock. The answers are put beside
// the store (reconcile.h), and the unit is ready, foreign, in fault or lost afterwards.
//
// A unit that has restarted, or lost the host, says so until it is resumed, which the question for
// its status does. An open move depends on that. Such a unit is read twice: up to its vectors and
// not resumed, then anew, when the store has what follows.
//
// Cost: about 14 frames of 140 bits a unit, so 100 units take 0.2 s of a 1 Mbit/s bus.
#pragma once

#include <cstdint>
#include <string>

#include "fleet/coordinate/coordination.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// A resting unit is asked for its health this many times less often than a moving one for its
/// progress.
inline constexpr std::int64_t kRestPollFactor = 10;

/// Starts to read the unit anew; what was under way with it is over.
void Identify(const Coordination& fleet, PositionerIndex i);
/// Asks the next question of the identification, or ends it.
void AskNext(const Coordination& fleet, PositionerIndex i);
/// The question that a unit without a session is asked: its identity.
[[nodiscard]] HostMessage FirstQuestion();
void OnIdentity(const Coordination& fleet, PositionerIndex i, const IdentifyReply& identity);
void OnVector(const Coordination& fleet, PositionerIndex i, const VectorReply& vector);
/// Pre: the unit is kIdentifying.
void OnStatusRead(const Coordination& fleet, PositionerIndex i, const StatusReply& status);
/// More of the store is durable: units that waited for it are resumed in this step.
void WakeStored(const Coordination& fleet);

/// The unit cannot be used any more: its phase is `phase`, and a kLost event says why. Without
/// `alarm` one alarm of the caller stands for many units.
void Lose(const Coordination& fleet, PositionerIndex i, UnitPhase phase, const std::string& reason,
          bool alarm = true);

/// The alarm of a unit in fault says which fault it is, as soon as that is known: the report of a
/// motion's end does not know it. Nothing where there is no such alarm.
void NameFault(const Coordination& fleet, PositionerIndex i, FaultCode fault);

/// Binds the serial number that answers at the place to it, and reads the unit anew.
Status Adopt(const Coordination& fleet, PositionerIndex i);

}  // namespace focalfleet
