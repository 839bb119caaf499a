// The state that every procedure of the coordinator shares, and the few things that one can do with
// it: change a unit's phase (by the table), ask a unit something (with a deadline and bounded
// retries), note a row for the store, raise an alarm, wake up later. It decides nothing; sessions.h
// and executor.h decide, and tell each other what happened to a unit through `events`, never by
// calling back.
//
// Size: about 300 bytes a unit and 1 kB a bus; a step touches only the units that have something
// due.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <queue>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "fleet/coordinate/bus_schedule.h"
#include "fleet/coordinate/clock_map.h"
#include "fleet/coordinate/unit_phase.h"
#include "fleet/coordinator.h"
#include "fleet/kinematics.h"
#include "protocol/wire/codec.h"

namespace focalfleet {

/// The one question that a unit has open. It is repeated with the same sequence number, so that the
/// unit can tell a repeat from a new question, and an old answer is never taken for a new one.
struct Question {
  HostMessage message;
  Function answer_function{};
  std::uint8_t sequence = 0;
  std::uint8_t tries = 0;
  std::uint32_t answer_bits = 0;  // that its answer will take
  HostInstant deadline = kNever;  // set when the frame leaves
  HostInstant asked = kNever;     // when it first left
  /// Where others depend on an answer by then: said once, before the retries are over.
  HostInstant suspect_at = kNever;
};

/// What has been read of a unit since it was last identified.
struct Reading {
  int step = 0;  // index of the next question, see sessions.cc
  StatusReply status;
  Pose position{};
  std::array<std::uint16_t, kAxisCount> subdivision{};
  std::array<std::int32_t, kAxisCount> counter1{};
};

struct UnitRecord {
  UnitView view;
  std::size_t bus = 0;  // index into Core::buses
  std::uint8_t sequence = 0;
  std::optional<Question> question;
  std::uint64_t write_request = 0;  // the command that waits for the answer to a written parameter
  Reading reading;
  /// What it holds otherwise than plans are made with, for people; empty: nothing. Such a unit is
  /// kFault, and read again with every poll.
  std::string unfit;
  std::optional<std::uint8_t> other_version;  // of the protocol, that it said last
  bool no_serial = false;                     // it said last that its serial number is 0
  std::string not_kept;      // why the store refuses its rows; empty: it does not. Kept in kFault.
  HostInstant due = kNever;  // when Service has something to do
  HostInstant next_poll{INT64_MIN};
  bool asked_once = false;  // has had the chance to answer since start
  // In motion: when others depend on where it is, and when the last question was asked to which it
  // answered that it moves.
  HostInstant watch_from = kNever;
  HostInstant watch_until{INT64_MIN};
  HostInstant seen_moving{INT64_MIN};
  /// Whoever was asked later than this and has not begun never will: the start may have been late.
  HostInstant begun_by{INT64_MIN};
  HostInstant answered_asked{INT64_MIN};  // when the question answered last was asked
  ClockMap clock;
  bool clock_reported = false;  // that its clock is off by more than plans allow for
  std::uint8_t protocol_version = kProtocolVersion;  // that it said last
  /// Its sensors, being read or as read last.
  struct Sensing {
    std::uint8_t next_part = 0;
    std::uint8_t parts = 0;
    bool given_up = false;  // it does not tell them
    SensorReading reading;  // none before all parts have come
    [[nodiscard]] bool begun() const { return parts > 0 || given_up; }
    [[nodiscard]] bool under_way() const { return next_part < parts; }
  } sensing;
  /// A unit of unknown place was found there; its own count is being set to it, axis by axis.
  struct Locating {
    Pose place{};
    Axis axis = Axis::kTheta;  // whose count is written now
    Pose count{};              // as the unit took it
  };
  std::optional<Locating> locating;
  bool wants_start = false;  // began with the others; when, is not known yet
  ClockMap::Instant began;   // told last
  // Stops of ours, so that one of somebody else's is told from them.
  /// Of the last ones that it was asked for, newest first: answers may come late, and repeated.
  std::array<std::uint8_t, 4> stop_sequences{};
  HostInstant reported_to_stop{INT64_MIN};  // the last one past the queue, under sequence number 0
  bool runs_freely = false;                 // set in motion, and not stopped by us since
};

struct BusRecord {
  BusId id;
  BusSchedule schedule;
  BusView view;
  HostInstant clock_due{INT64_MIN};
  HostInstant window_began = kNever;  // of the second over which the load is taken
  std::uint64_t window_bits = 0;
  // Of the upload under way: its first frame let go, its last unit armed.
  HostInstant upload_began = kNever;
  HostInstant upload_ended{INT64_MIN};
  std::vector<PositionerIndex> units;
};

/// Frames that an upload consists of, both directions.
constexpr bool IsOfUpload(const CanFrame& frame) {
  const auto function = static_cast<Function>(frame.id >> 20 & 63);
  return function == Function::kStageBegin || function == Function::kStageSegment ||
         function == Function::kConfirm || function == Function::kArm;
}

enum class UnitEventKind : std::uint8_t {
  kReady,          // read anew, or its motion ended where it should: its knowledge is settled
  kStopped,        // its motion ended before its end
  kNeverBegan,     // did not start with the others
  kUnheard,        // in motion, does not answer at once, or has not begun yet: may have ended
  kEnded,          // in motion, says that it stands, not yet where
  kLost,           // silent, restarted, foreign or faulty: not to be counted on
  kForeignStop,    // it obeyed a stop that is not ours
  kStartReported,  // when it began is known
};
struct UnitEvent {
  PositionerIndex unit;
  UnitEventKind kind;
  std::string reason;
};

class Core {
 public:
  Core(const Layout* layout, std::vector<UnitDrive> drives, const CoordinatorConfig& config,
       StoredFleet stored);

  // ---- who

  [[nodiscard]] UnitRecord& unit(PositionerIndex i) { return units[i.value]; }
  [[nodiscard]] BusRecord& bus_of(PositionerIndex i) { return buses[unit(i).bus]; }
  [[nodiscard]] std::string NameOf(PositionerIndex i) const;  // "unit 12"
  [[nodiscard]] BusRecord* FindBus(BusId id);
  /// What keeps it from being moved, and what helps, to go after its name or "it":
  /// "is in fault (driver): `focalfleet enable 9` clears it". Pre: it is not kReady.
  [[nodiscard]] std::string TroubleOf(PositionerIndex i) const;
  /// What is known instead of a place, and what helps, to go after "its place": "is not known:
  /// `focalfleet home 9` ...". Pre: it is at no known place.
  [[nodiscard]] std::string WhyNoPlace(PositionerIndex i) const;
  /// Where the serial number that answers at this place belongs: "which belongs to unit 8", or
  /// "which belongs to no unit".
  [[nodiscard]] std::string WhoseSerial(PositionerIndex i) const;

  // ---- doing

  void SetPhase(PositionerIndex i, UnitPhase phase);
  void Changed(PositionerIndex i);
  void SetDue(PositionerIndex i, HostInstant at);
  /// Replaces any open question. Where the bus's queue is full the question is asked when it has
  /// room. `answer_bits`: what the answer will take, where that is known; else a fair guess.
  void Ask(PositionerIndex i, const HostMessage& message, std::uint32_t answer_bits = 0);
  /// The sequence number of the question after `questions` more ones.
  [[nodiscard]] std::uint8_t SequenceAfter(PositionerIndex i, int questions) const;
  void Forget(PositionerIndex i);  // its open question, and what waits for it on the bus
  /// True where a retry went out; false where the last one is over: nobody answers.
  [[nodiscard]] bool AskAgain(PositionerIndex i);
  /// How long a question may stay open, all repeats included.
  [[nodiscard]] DurationNs Patience() const;
  /// Frames past the queue: stops, starts, the clock.
  void SendNow(std::size_t bus, const HostMessage& message, NodeId node);
  /// A `done, stopped` under this sequence number, which no open question waits for, may answer a
  /// stop of ours: a copy, or the answer to one past the queue.
  [[nodiscard]] bool MayAnswerOurStop(PositionerIndex i, std::uint8_t sequence) const;
  template <class AnyRow>
  void Note(AnyRow&& row) {
    out->rows.emplace_back(std::forward<AnyRow>(row));
  }
  void Raise(Severity severity, std::optional<PositionerIndex> unit, std::optional<BusId> bus,
             std::string text);
  void Tell(PositionerIndex i, UnitEventKind kind, std::string reason = {});
  /// Answers when this step's rows are durable; at once, with an error, where they cannot be
  /// written.
  void ReplyWhenDurable(std::uint64_t request, std::string text);
  /// Replies that wait for these batches, both included, tell instead that it is not stored.
  void RefuseReplies(std::uint64_t first_batch, std::uint64_t last_batch, const std::string& why);

  /// Where it stands when its own count of vectors says `count`.
  [[nodiscard]] Pose PlaceAt(PositionerIndex i, const Pose& count) const;
  /// Places that its own counts can have: the unit holds itself to its range by the count.
  [[nodiscard]] std::array<VectorRange, kAxisCount> RangesOf(PositionerIndex i) const;
  /// The pose itself where it is within these; else with theta another whole turn on, where that
  /// is; else as near as its axes get.
  [[nodiscard]] Pose NearestInReach(PositionerIndex i, const Pose& pose) const;
  /// The camera or its own sensors found it at `place`, where its count had it elsewhere: the count
  /// is right from here on, but for the offset. Pre: it stands at one known place.
  void See(PositionerIndex i, const Pose& place, MeasurementSource source);
  /// A model has it that its place is so much more than its count. Pre: as See.
  void Expect(PositionerIndex i, const Pose& offset);
  /// Knowledge of a unit that is settled now: kept here and in the store.
  void Know(PositionerIndex i, const UnitKnowledge& knowledge, Origin origin);
  /// Closes the unit's open intent, if there is one.
  void EndIntent(PositionerIndex i, IntentEnd end);

  /// The batch number that this step's rows will carry.
  [[nodiscard]] std::uint64_t batch_now() const { return next_batch; }

  /// A number that no unit holds a move under. Numbers are taken from a stock that the store knows
  /// as used: a run that is killed may have armed units that nobody hears any more, and the next
  /// one's start signals reach them. Pre: MovesAreReserved().
  MoveId TakeMoveId();
  [[nodiscard]] bool MovesAreReserved() const { return committed_through >= reserved_by_; }

  // ---- being driven

  void BeginStep(const Inputs& inputs, Effects* effects);
  /// Matches an answer to the open question; false: late, doubled, or not asked, not yet either.
  [[nodiscard]] bool Answers(PositionerIndex i, Function function, std::uint8_t sequence);
  /// Frames that passed the bus together: one, or those of a group.
  void Count(BusRecord* bus, std::span<const CanFrame> frames);
  void EndStep();
  /// Units that are due at `now`, in the order of their times.
  [[nodiscard]] std::optional<PositionerIndex> NextDue();

  const Layout& layout;
  const CoordinatorConfig config;
  const BusRates rates;
  std::vector<UnitDrive> drives;
  std::vector<UnitRecord> units;
  std::vector<BusRecord> buses;
  std::unordered_map<SerialNumber, VectorRow> stored_vectors;
  std::unordered_map<SerialNumber, IntentRow> intents;  // open ones
  std::unordered_map<SerialNumber, PositionerIndex> place_of;
  std::vector<ConfigurationRow> earlier_configurations;  // as stored
  std::vector<UnitEvent> events;
  std::uint64_t next_configuration = 1;
  std::uint64_t next_alarm = 1;
  std::uint64_t next_exposure = 1;
  std::uint64_t next_batch = 1;
  std::uint64_t committed_through = 0;
  bool store_failing = false;
  HostInstant now;
  /// Frames heard so far had ended by then; later than `now` where the host was held up on its way
  /// to them.
  HostInstant heard_until{INT64_MIN};
  Effects* out = nullptr;

 private:
  void SayWhatIsDurable();

  struct KeptReply {
    std::uint64_t batch;
    std::uint64_t request;
    std::string text;
    std::string refused = {};  // why it is not stored, and never will be
  };
  std::deque<KeptReply> kept_replies_;

  struct Timer {
    HostInstant at;
    PositionerIndex unit;
    bool operator>(const Timer& o) const { return at != o.at ? at > o.at : unit > o.unit; }
  };

  void ReserveMoves();

  MoveId next_move_;
  std::uint32_t moves_left_ = 0;
  std::uint64_t reserved_by_ = 0;  // the batch of the first stock

  void CloseLoadWindow(BusRecord* bus) const;
  void CountSent();
  void DropQuestion(PositionerIndex i);

  std::priority_queue<Timer, std::vector<Timer>, std::greater<>> timers_;
  std::vector<PositionerIndex> asked_;
  std::vector<std::uint8_t> is_changed_;
};

}  // namespace focalfleet
