// The view of a unit is what the coordinator publishes of it: its phase, its place with a witness,
// and the outcome of its target. The working state of the coordinator is in unit_record.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "fleet/knowledge.h"
#include "fleet/measurement.h"
#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

/// The step of the coordinator's work with one unit. Transitions: kAllowed in unit_phase.h.
enum class UnitPhase : std::uint8_t {
  kAbsent,       // has not answered (yet)
  kIdentifying,  // answered; its vectors are being read
  kForeign,      // another serial number than the one bound here: not moved until adopted
  kReady,
  kStaging,
  kConfirming,
  kArming,
  kArmed,
  kMoving,
  kHoming,
  kSettling,  // it still moves by itself, and is asked until it rests (settling.h)
  kFault,
  kSilent,  // answered before, does not now
};
inline constexpr std::uint8_t kUnitPhaseCount = 13;
const char* Name(UnitPhase phase);

/// The outcome of a unit's target in the current or last configuration. The values stand in the
/// order of the DDS codes.
enum class TargetOutcome : std::uint8_t {
  kNone,        // it had no target
  kPending,     // under way
  kArrived,     // the end of its motion is reported and stored; if measured: within the tolerance
  kRefused,     // it was not moved
  kFailed,      // it did not arrive, or was measured beyond the tolerance
  kStopped,     // an operator's stop, or a stop on the bus, came first
  kUnmeasured,  // its motion ended as reported, and no measurement that was asked for confirms it
};
inline constexpr TargetOutcome kLastTargetOutcome = TargetOutcome::kUnmeasured;
constexpr const char* Name(TargetOutcome outcome) {
  constexpr const char* kNames[] = {"none",   "pending", "arrived",   "refused",
                                    "failed", "stopped", "unmeasured"};
  return kNames[static_cast<std::size_t>(outcome)];
}
/// True where the configuration did not do for this unit what was asked of it.
constexpr bool IsUnserved(TargetOutcome outcome) { return outcome > TargetOutcome::kArrived; }

/// How a unit's clock runs against the host's (fleet/coordinate/clock_map.h).
struct ClockView {
  std::uint32_t readings = 0;  // on which the rate rests
  double rate_error = 0;       // the unit's seconds a host second, less 1
  double rate_bound = 0;       // the true rate error is within rate_error +- rate_bound
  double bound_s = 0;          // error of the time of the newest reading
};

struct UnitView {
  UnitPhase phase = UnitPhase::kAbsent;
  UnitKnowledge knowledge;  // while it moves: the hull
  Pose offset{};            // its place less its own count of vectors (VectorRow::offset)
  std::optional<MeasurementStatus> measurement;  // in the last exposure; none: not looked for
  std::optional<double> error_um;                // distance from the target in the last measurement
  MeasurementSource source = MeasurementSource::kCamera;  // source of error_um
  CovarianceFp covariance;                                // covariance of the measured place
  std::optional<FibreCarrierReading> carrier;             // last reading of the unit's own sensors
  SerialNumber serial;                                    // serial number that answers; 0: none yet
  SerialNumber bound_serial;  // serial number bound to this place; 0: none yet
  UnitState reported_state = UnitState::kRest;
  FaultCode fault = FaultCode::kNone;
  MoveId move;
  bool enabled = true;
  std::string disabled_reason;
  TargetOutcome outcome = TargetOutcome::kNone;
  std::string outcome_reason;  // why refused or failed, for people
  std::optional<Pose> target;
  ClockView clock;
};

}  // namespace focalfleet
