// The one transition function of the fleet: Step(inputs) -> effects. It holds what is known of
// every unit and bus, and what is being done about it; it has no clock, thread, file, socket or
// log. The shell polls, calls Step, and performs the effects in this order:
//
//   rows      to the store:   one transaction a batch; Inputs::committed_through tells of it
//   frames    to the buses:   in their order
//   plan_job  to the planner: RunPlanJob on a thread of its own; PlanDone brings the answer
//   exposure  to the camera:  ExposureDone brings the answer
//   replies   to whoever sent the command
//   changed   to DDS:         the newest value of each unit is enough
//
// Rows that a motion needs come first: a start signal is among the frames of a later step, when
// the batch with its intent is durable. Frames that stop a unit wait for nothing.
//
// A configuration is a goal, pursued in rounds: plan from where everything stands, stage, confirm
// by read-back, arm, commit the intent, start, watch. A unit that falls out at any step is named
// and frozen, and the next round plans around it; units held back to protect it go on then. The
// number of rounds is bounded. docs/way_of_a_move.md follows one move through here.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/replan.h"
#include "fleet/records.h"
#include "protocol/base/instants.h"
#include "protocol/link/frame_port.h"

namespace focalfleet {

// ---- what comes in

struct LinkEvent {
  BusId bus;
  LinkState state = LinkState::kUp;
  std::string cause = {};  // for people; empty: not known
};

/// Commands carry the number that their replies name.
struct ApplyCommand {
  std::string source;
  std::vector<std::optional<Pose>> targets;  // Shape: (n)
  bool fixed = false;
  /// What targets are called, carried through to every report. Shape: (n), or empty: nothing.
  std::vector<std::string> target_ids = {};
  /// Given: look with the camera when all have arrived, send those again that are farther off than
  /// the tolerance, and look again, at most so many times.
  struct Measure {
    std::uint8_t corrections = 0;
    double tolerance_um = 10;
    /// What is found is told and stored, and not used: the units go on by what they report, and
    /// come as the way comes. Campaigns measure the blind moves so.
    bool observe = false;
  };
  std::optional<Measure> measure = {};
  /// By a model of the fleet: how much more than its own count each unit's place will be at its
  /// target. Shape: (n), or empty: no model. A unit without one keeps its offset.
  std::vector<std::optional<Pose>> offsets = {};
};
/// Another target for one unit of the configuration that is under way; it need not have had one.
/// A unit that moves is stopped first. Answered when it starts, or with why it does not.
struct RetargetCommand {
  PositionerIndex unit;
  Pose target{};
};
struct StopCommand {
  std::optional<PositionerIndex> unit;  // none: all
};
/// The camera, or the units' own sensors, look once; nobody moves. Units of unknown place are put
/// where they are found. Targets of the configuration before stay, so that errors can be told.
struct MeasureCommand {};
struct HomeCommand {
  std::vector<PositionerIndex> units;
  bool unproven =
      false;  // the operator takes it on himself: home also where a neighbour may be in the way
};
struct EnableCommand {
  std::vector<PositionerIndex> units;
  bool enabled = true;
  std::string reason;
};
struct AdoptCommand {  // take the serial number that answers at this place as its own
  PositionerIndex unit;
};
struct WriteParameterCommand {
  PositionerIndex unit;
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kRepeat;
  std::int32_t value = 0;
};
/// A change that the shell has made already, to be kept.
struct KeepModelCommand {
  ModelRow row;
};
struct Command {
  std::uint64_t request = 0;
  std::variant<ApplyCommand, RetargetCommand, StopCommand, HomeCommand, MeasureCommand,
               EnableCommand, AdoptCommand, WriteParameterCommand, KeepModelCommand>
      what;
};

/// What carrying out a plan will take and draw.
struct PlanPrediction {
  double makespan_s = 0;
  double energy_J = 0;
  double peak_power_W = 0;
};

/// A planner's answer (fleet/plan/job.h).
struct PlanDone {
  std::uint64_t job = 0;
  Result<Plan> plan;
  std::vector<PositionerIndex>
      homing;  // units that may home at once when `plan` has been carried out
  PlanPrediction predicted;
  /// Of a plan for a configuration: what late moves in it are planned with.
  std::shared_ptr<const RunningPlan> running;
  std::optional<Result<LateMove>> late;  // of a job for a late move; `plan` is empty then
};

/// The answer to an ExposureJob.
struct ExposureDone {
  std::uint64_t id = 0;
  Result<ExposureFindings> exposure;
};

/// A message of the shell about itself; it becomes an alarm.
struct ShellNote {
  Severity severity = Severity::kInfo;
  std::string text;
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
  /// Rows of batches up to committed_through that the store set aside, each told once.
  std::span<const RefusedRow> refused = {};
};

// ---- what goes out

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
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
  std::vector<Pose> offsets;  // PlanRequest::offsets
  PlanOptions options;
  std::vector<PositionerIndex>
      to_home;            // not empty: plan the next wave of homing, `targets` is empty
  bool unproven = false;  // of homing, see HomeCommand
  std::shared_ptr<const LateJob> late;  // then nothing else is looked at
};

/// Take an exposure now, and say where each unit is found. All units rest.
struct ExposureJob {
  std::uint64_t id = 0;
  HostInstant since;  // the exposure begins no earlier
  std::vector<UnitKnowledge> expected;
  std::vector<std::optional<Pose>> before;  // where it stood before it was sent; none: not known
  /// What a unit of unknown place says itself. The store contradicts it, so it is a hypothesis.
  std::vector<std::optional<Pose>> reported;
  std::vector<std::uint8_t> seen;  // non-zero: a camera has put it somewhere before
  // Shapes: (n). What units with sensors showed; who has a target and is to be found, so that no
  // exposure is needed where their own sensors say it exactly enough.
  std::vector<SensorReading> readings = {};
  std::vector<std::uint8_t> wanted = {};
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
  std::vector<PositionerIndex> changed;  // units whose status differs from what was last told
  HostInstant wake_at = kNever;

  void Clear();
};

// ---- what can be seen

/// What the coordinator is doing with one unit. Transitions: kAllowed in unit_phase.h.
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
  kSettling,  // its motion should be over; being asked
  kFault,
  kSilent,  // answered before, does not now
};
inline constexpr std::uint8_t kUnitPhaseCount = 13;
const char* Name(UnitPhase phase);

/// What came of a unit's target in the current or last configuration. The values stand in the
/// order of the DDS codes.
enum class TargetOutcome : std::uint8_t {
  kNone,        // it had no target
  kPending,     // under way
  kArrived,     // the end of its motion is reported and stored; if measured: within the tolerance
  kRefused,     // it was not moved
  kFailed,      // it did not arrive, or was measured beyond the tolerance
  kStopped,     // an operator's stop, or a stop on the bus, came first
  kUnmeasured,  // its motion ended as told, and no measurement that was asked for confirms it
};
inline constexpr TargetOutcome kLastTargetOutcome = TargetOutcome::kUnmeasured;
constexpr const char* Name(TargetOutcome outcome) {
  constexpr const char* kNames[] = {"none",   "pending", "arrived",   "refused",
                                    "failed", "stopped", "unmeasured"};
  return kNames[static_cast<std::size_t>(outcome)];
}
/// The configuration did not do for this unit what was asked of it.
constexpr bool IsUnserved(TargetOutcome outcome) { return outcome > TargetOutcome::kArrived; }

/// How a unit's clock runs against the host's (fleet/coordinate/clock_map.h).
struct ClockView {
  std::uint32_t readings = 0;  // that it is known from
  double rate_error = 0;       // its seconds a second of the host's, less 1
  double rate_bound = 0;       // the true one is within rate_error +- rate_bound
  double bound_s = 0;          // what the newest reading is known to
};

struct UnitView {
  UnitPhase phase = UnitPhase::kAbsent;
  UnitKnowledge knowledge;  // while it moves: the hull
  Pose offset{};            // its place less its own count of vectors (VectorRow::offset)
  std::optional<MeasurementStatus>
      measurement;                 // of the last exposure; none: it was not looked for
  std::optional<double> error_um;  // from its target, as last measured
  MeasurementSource source = MeasurementSource::kCamera;  // of that
  CovarianceFp covariance;                                // of that; of its place, where it was put
  std::optional<FibreCarrierReading> carrier;             // of its sensors' last reading
  SerialNumber serial;                                    // that answers; 0: none yet
  SerialNumber bound_serial;                              // that belongs here; 0: none yet
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

/// How far apart the units of a round began, by their own clocks; of several rounds the widest.
struct StartView {
  std::uint32_t round = 0;     // 0: none yet
  std::uint32_t begun = 0;     // units that were started
  std::uint32_t reported = 0;  // those of which it is known when they began
  double skew_s = 0;           // from the first start to the last, the likeliest
  double bound_s = 0;          // the true skew is within skew_s +- bound_s
  double least_s = 0;          // and within these, both included
  double most_s = 0;
  double allowed_s = 0;  // that the plan was made for
  std::optional<PositionerIndex> first = {};
  std::optional<PositionerIndex> last = {};
};

/// Getting the moves of a configuration onto the wire. Counted are the frames without which a unit
/// is not armed: stage_begin, stage_segment, confirm and arm with their answers.
struct UploadView {
  // Of the nominal bit rate: CAN FD counts by its time. Known before the first is sent: exact, each
  // frame once, groups as full as can be.
  std::uint64_t bits_predicted = 0;
  std::uint64_t bits = 0;  // as they passed: repeats and late moves included
  double predicted_s = 0;  // bits_predicted by the bit rate; of all buses the longest
  double measured_s = 0;   // first frame let go to last unit armed; of all buses the longest
};

struct BusView {
  LinkState link = LinkState::kUp;
  std::uint64_t frames_sent = 0;
  std::uint64_t frames_received = 0;
  std::uint64_t bits = 0;  // both directions, exact
  std::uint64_t malformed = 0;
  std::uint64_t retries = 0;
  double load = 0;      // of the last second
  double load_max = 0;  // highest second since the configuration began
  UploadView upload;    // of the configuration, all rounds
};

/// What the exposures of a configuration found of the units that have targets.
struct MeasuredRound {
  std::uint64_t exposure = 0;
  std::uint32_t measured = 0;
  std::uint32_t unknown = 0;           // seen nowhere, or not to be told from another
  std::uint32_t within_tolerance = 0;  // of `measured`
  std::uint32_t by_sensors = 0;        // of `measured`: by the unit's own
  bool camera = true;                  // looked, too
  double rms_um = 0;                   // of the distances from the targets, of `measured`
  double median_um = 0;
  double worst_um = 0;
};

/// What a configuration was asked to do with its units.
enum class ConfigurationKind : std::uint8_t { kApply, kHome, kMeasure };
constexpr const char* Name(ConfigurationKind kind) {
  constexpr const char* kNames[] = {"apply", "home", "measure"};
  return kNames[static_cast<std::size_t>(kind)];
}

struct ConfigurationView {
  std::uint64_t id = 0;
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::string source;
  ConfigurationState state = ConfigurationState::kDone;
  std::uint32_t round = 0;
  std::uint32_t targeted = 0;
  std::uint32_t arrived = 0;
  std::uint32_t refused = 0;
  std::uint32_t failed = 0;
  std::uint32_t stopped = 0;
  std::uint32_t unmeasured = 0;
  double makespan_predicted_s = 0;  // all rounds that were started
  double makespan_s = 0;            // start signals to last arrival, all rounds
  double energy_J = 0;              // predicted, of the same
  double peak_power_W = 0;          // predicted, of the same
  std::uint64_t frames = 0;         // both directions, all buses, since it began
  UploadView upload;                // bits of all buses, all rounds
  StartView starts;
  HostInstant began;
  HostInstant started;                  // start signal of this round; kNever before it
  std::string waiting_for;              // what holds it up, for people; usually empty
  std::vector<MeasuredRound> measured;  // blind, then after each correction
  std::string not_measured;  // why the last exposure that was due failed; empty: none did
};

struct CoordinatorConfig {
  std::uint32_t bit_rate_bps = 1'000'000;
  std::uint32_t data_bit_rate_bps = 0;  // of groups on buses with CAN FD (docs/adr/0008); 0: none
  DurationNs reply_wait =
      Milliseconds(50);  // one request's answer; repeats wait 2, 4, 8, 16 times that
  DurationNs identify_period = Milliseconds(2000);  // absent and silent units are asked again
  DurationNs poll_period =
      Milliseconds(1000);  // progress of each moving unit; health of each resting one x10
  /// From the end of a unit by itself to the stop of those that would come where it stands; what
  /// plans are made with, unless reply_wait asks for more (fleet/coordinate/stall_detection.h).
  DurationNs notice = Milliseconds(1000);
  DurationNs clock_period = Milliseconds(500);
  DurationNs start_delay = Milliseconds(250);    // start frame to start instant, all buses
  DurationNs settle_margin = Milliseconds(500);  // after the predicted end before a unit is asked
  DurationNs transmit_horizon =
      Milliseconds(4);  // how far ahead of the bit clock frames are released
  DurationNs silence_limit = Milliseconds(3000);  // without an answer: silent
  /// A SYNC line tells the common start by an edge. Start frames then say an instant `sync_lead`
  /// after it, for units that have no such line or miss the edge.
  bool sync_line = false;
  bool reads_sensors = false;  // of units that have some (units.csv, [hall] model)
  bool has_camera = false;     // else a configuration that asks for one is refused
  DurationNs sync_lead = Milliseconds(5);
  /// A configuration that is measured ends each axis' way with this last piece, in this direction,
  /// so that play and wind-up of a gear are always on one side. 0: as the way comes.
  std::array<double, kAxisCount> approach_deg = {-2, -2};
  /// A correction that is not the last ends so far short of the target where it needed a
  /// unidirectional approach, so that the last one is short and goes on in the same direction: a
  /// long way scatters, a short one does not. Three times what a unidirectional approach there and
  /// back scatters by.
  double creep_deg = 0.06;
  /// Standard deviation of where an axis ends, after a way that is long: after a way d it is that
  /// times sqrt(2 (1 - exp(-d / 360 deg))), as robots in service have it.
  double scatter_deg = 0.12;
};

class Coordinator {
 public:
  /// `layout` outlives the coordinator.
  Coordinator(const Layout* layout, std::vector<UnitDrive> drives, CoordinatorConfig config,
              StoredFleet stored);
  ~Coordinator();

  /// Takes in what has come since the last step and appends to `effects` what is to be done. Inputs
  /// are taken in this order, each list from its front: notes, rows that the store refused, links,
  /// frames, plans, exposures, commands; then everything that is due at `now`. So a command is
  /// decided by what was heard in the same step, and a stop ends what an answer has just begun.
  /// The same inputs in the same order give the same effects, to the bit. Pre: `now` is not before
  /// that of the last step; `effects` is clear; frames are of buses of the layout. Cost: as many
  /// units as are heard, commanded or due, and one pass over the units of a configuration.
  void Step(const Inputs& inputs, Effects* effects);
  /// The shell ends: what must still be written. Units that move finish by themselves.
  void End(HostInstant now, Effects* effects);

  [[nodiscard]] const UnitView& unit(PositionerIndex i) const;
  /// Knowledge for showing: as `unit(i).knowledge`, but a moving unit's is predicted at `now`.
  [[nodiscard]] UnitKnowledge KnowledgeAt(PositionerIndex i, HostInstant now) const;
  [[nodiscard]] const BusView& bus(BusId bus) const;
  [[nodiscard]] const ConfigurationView& configuration() const;
  [[nodiscard]] std::span<const UnitDrive> drives() const;
  [[nodiscard]] const CoordinatorConfig& config() const;
  [[nodiscard]] bool busy() const;  // a configuration or homing is under way

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
