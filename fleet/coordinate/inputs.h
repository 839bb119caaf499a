// Inputs are everything that one step of the coordinator takes in. They are frames, links,
// commands, answers of the planner and of the camera, and how far the store has come.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/measurement.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/replan.h"
#include "fleet/records.h"
#include "protocol/base/instants.h"
#include "protocol/base/result.h"
#include "protocol/link/frame_port.h"

namespace focalfleet {

struct LinkEvent {
  BusId bus;
  LinkState state = LinkState::kUp;
  std::string cause = {};  // for people; empty: not known
};

/// Time, energy and power that carrying out a plan will take.
struct PlanPrediction {
  double makespan_s = 0;
  double energy_J = 0;
  double peak_power_W = 0;
};

/// A planner's answer (fleet/plan/job.h).
struct PlanDone {
  std::uint64_t job = 0;
  PlanPurpose purpose = PlanPurpose::kConfiguration;
  Result<Plan> plan;
  std::vector<PositionerIndex>
      homing;  // units that may home at once when `plan` has been carried out
  PlanPrediction predicted;
  /// The basis of late moves within this plan; null unless the plan is for a configuration.
  std::shared_ptr<const RunningPlan> running;
  std::optional<Result<LateMove>> late;  // of a job for a late move; `plan` is empty then
  /// The search was given up when it asked for this time; 0: never. A plan that was complete by
  /// then stays, and the same number makes it again.
  std::uint64_t given_up_at_look = 0;
};

/// The answer to an ExposureJob.
struct ExposureDone {
  std::uint64_t id = 0;
  Result<ExposureFindings> exposure;
};

/// A message of the shell about itself; it becomes an alarm.
struct ShellNote {
  AlarmName name = AlarmName::kUnnamed;
  std::string text;
  std::optional<AlarmName> ends = {};  // the condition that has ended with it
};

struct Inputs {
  HostInstant now;
  std::span<const ReceivedFrame> frames;
  std::span<const LinkEvent> links;
  std::span<const Command> commands;
  std::span<const PlanDone> plans;
  std::span<const ExposureDone> exposures = {};
  std::span<const ShellNote> notes = {};
  std::uint64_t committed_through = 0;  // highest batch that is durable
  bool store_failing = false;           // the last attempt to commit failed; the shell tries again
  /// Rows of batches up to committed_through that the store set aside, each given once.
  std::span<const RefusedRow> refused = {};
};

}  // namespace focalfleet
