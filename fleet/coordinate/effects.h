// Effects are everything that one step of the coordinator asks of the shell. They are rows for the
// store, frames for the buses, jobs for the planner and the camera, and replies to commands.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/sector_round.h"
#include "fleet/knowledge.h"
#include "fleet/measurement.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/replan.h"
#include "fleet/records.h"
#include "protocol/base/instants.h"
#include "protocol/base/result.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet {

struct OutFrame {
  BusId bus;
  CanFrame frame;
};

/// A late move within a configuration under way (fleet/plan/replan.h).
struct LateJob {
  std::shared_ptr<const RunningPlan> running;
  ReplanQuestion question;
  std::vector<Deviation> deviations;
};

struct PlanJob {
  std::uint64_t job = 0;
  PlanPurpose purpose = PlanPurpose::kConfiguration;
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
  std::vector<Pose> offsets;  // PlanRequest::offsets
  PlanOptions options;
  std::vector<PositionerIndex>
      to_home;            // not empty: plan the next wave of homing, `targets` is empty
  bool unproven = false;  // of homing, see HomeCommand
  std::shared_ptr<const LateJob> late;  // then nothing else is read
};

/// Asks for an exposure now, and for the place of each unit in it. All units rest.
struct ExposureJob {
  std::uint64_t id = 0;
  HostInstant since;  // the exposure begins no earlier
  std::vector<UnitKnowledge> expected;
  std::vector<std::optional<Pose>> before;  // its place before its last move; none: not known
  /// The place that a unit of unknown place reports. The store contradicts it, so it is a
  /// hypothesis.
  std::vector<std::optional<Pose>> reported;
  std::vector<std::uint8_t> seen;  // non-zero: a camera has put it somewhere before
  // Units with sensors: their readings, and which of them have a target and are to be found. No
  // exposure is needed where all wanted units are known well enough by their own sensors.
  std::vector<SensorReading> readings = {};  // Shape: (n)
  std::vector<std::uint8_t> wanted = {};     // Shape: (n)
  double tolerance_um = 0;
};

struct ReplyEffect {
  std::uint64_t request = 0;
  bool last = true;  // false: progress, more will come
  std::optional<Error> error;
  std::string text;
};

struct Effects {
  std::uint64_t batch = 0;  // number of this batch of rows, 0 where there are none
  std::vector<Row> rows;
  std::vector<OutFrame> frames;
  std::optional<PlanJob> plan_job;
  std::optional<ExposureJob> exposure;
  std::vector<ReplyEffect> replies;
  std::optional<HostInstant> sync_at;    // an edge on the SYNC line is due then
  std::vector<PositionerIndex> changed;  // units whose status differs from the published one
  std::vector<BorderEnd> border_ends;    // of a sector: for the sectors beyond its border
  HostInstant wake_at = kNever;

  void Clear();
};

}  // namespace focalfleet
