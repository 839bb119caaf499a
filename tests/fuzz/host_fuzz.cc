// The test runs the coordinator under units that may answer anything at any time and operators who
// may ask for anything. Links come and go, and the host may be killed (kill -9). The input is
// records of 12 bytes: event (1), unit or bus (1), delay (1), a number (1), data (8). Three simple
// units on two buses answer correctly until a record changes that, so a record may go wrong deep
// within a configuration. For any input:
//
//   every frame that the coordinator sends is well formed and for a unit that exists, or for all;
//   a start is only sent when the intent of every unit that holds its move is durable;
//   it asks to be woken later than now, and never asks for ever in one instant.
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "fleet/coordinator.h"
#include "fleet/plan/job.h"
#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/wire/codec.h"
#include "tests/scenario/in_process_fleet.h"

namespace focalfleet {
namespace {

constexpr std::size_t kRecord = 12;
constexpr std::size_t kRecordsMax = 60;
constexpr std::uint32_t kUnits = 3;
constexpr int kStepsPerRecord = 400;
constexpr std::uint64_t kCommitSteps = 5;  // exposes a start before its durable intent

Layout ThreeInARow() {
  std::vector<Unit> units(kUnits);
  for (std::uint32_t n = 0; n < kUnits; ++n) {
    units[n].id = UnitId{n + 1};
    units[n].base_fp = {25.6 * n, 0};
    units[n].axis = {AxisGeometry{8.25, 0, 892, -190, 190}, AxisGeometry{8.25, 0, 892, 0, 190}};
    units[n].bus = BusId{n / 2};
    units[n].node = NodeId{static_cast<std::uint8_t>(n + 1)};
  }
  return Layout::Create(std::move(units), {}).value();
}

/// Answers as a unit would, and moves in no time.
struct FakeUnit {
  NodeId node;
  SerialNumber serial;
  Pose position{0, 20'000};
  std::uint16_t subdivision = 96;
  std::int32_t counter1 = 500;
  UnitState state = UnitState::kRest;
  bool interrupted = false;
  bool restarted = true;
  bool silent = false;
  bool keeps_done = false;  // sends nothing at the end of a motion
  MoveId begun;
  StagedMove staged;
  std::uint8_t asked = 0;  // the last sequence number

  std::vector<UnitMessage> Hear(const HostMessage& message) {
    return std::visit([this](const auto& m) { return On(m); }, message);
  }

 private:
  using Answers = std::vector<UnitMessage>;
  [[nodiscard]] Done DoneAs(Outcome outcome) const { return {outcome, position, begun}; }
  Answers On(const Stop&) {
    if (state != UnitState::kFault) state = UnitState::kRest;
    return {DoneAs(Outcome::kStopped)};
  }
  Answers On(const Start& start) {
    if (state != UnitState::kArmed || start.move != staged.move) return {};
    for (const Axis axis : kAxes)
      for (const Segment& segment : staged.path[Index(axis)].segments())
        position[Index(axis)] += segment.delta;
    begun = start.move;
    state = UnitState::kRest;
    if (keeps_done) return {};
    return {DoneAs(Outcome::kArrived)};
  }
  Answers On(const Clock&) { return {}; }
  Answers On(const ClockRequest&) { return {ClockReply{1}}; }
  Answers On(const Arm& arm) {
    state = UnitState::kArmed;
    return {ArmReply{arm.move, Answer::kOk}};
  }
  Answers On(const Confirm& confirm) {
    return {ConfirmReply{
        confirm.move, Digest(staged), {staged.path[0].size(), staged.path[1].size()}, Answer::kOk}};
  }
  Answers On(const StageBegin& begin) {
    staged = {.move = begin.move, .mode = begin.mode, .path = {}};
    state = UnitState::kStaging;
    return {};
  }
  Answers On(const StageSegment& m) {
    AxisPath& path = staged.path[Index(m.axis)];
    if (!path.full()) path.Append(m.segment);
    return {};
  }
  Answers On(const Home& home) {
    begun = home.move;
    interrupted = false;
    return {HomeReply{home.move, Answer::kOk}, DoneAs(Outcome::kHomed)};
  }
  Answers On(const ProgressRequest&) { return {ProgressReply{state, position, begun}}; }
  Answers On(const StatusRequest& m) {
    const bool was = restarted;
    if (m.resume) restarted = false;
    return {StatusReply{.state = state,
                        .fault = state == UnitState::kFault ? FaultCode::kDriver : FaultCode::kNone,
                        .interrupted = interrupted,
                        .restarted = was,
                        .move = begun}};
  }
  Answers On(const VectorRequest& m) {
    const std::int32_t at = position[Index(m.axis)];
    const std::int32_t turns = (at >= 0 ? at : at - (subdivision - 1)) / subdivision;
    return {VectorReply{m.axis, static_cast<std::uint16_t>(at - turns * subdivision), subdivision,
                        turns}};
  }
  Answers On(const FaultRequest& m) {
    if (m.clear && state == UnitState::kFault) state = UnitState::kRest;
    return {FaultReply{}};
  }
  Answers On(const SensorsRequest&) { return {SensorsReply{}}; }
  Answers On(const IdentifyRequest&) { return {IdentifyReply{.serial = serial}}; }
  Answers On(const ParameterRead& m) {
    return {ParameterReply{false, m.axis, m.parameter, Answer::kOk, counter1}};
  }
  Answers On(const ParameterWrite& m) {
    if (m.parameter == Parameter::kCounter1) counter1 = m.value;
    return {ParameterReply{true, m.axis, m.parameter, Answer::kOk, m.value}};
  }
};

class Harness {
 public:
  Harness() : layout_(ThreeInARow()) {
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      fake_units_[n].node = layout_.units()[n].node;
      fake_units_[n].serial = {100 + n};
    }
    Restart();
    Pass(Milliseconds(200));
  }

  void Do(const std::uint8_t* record) {
    const std::uint32_t index = record[1] % kUnits;
    switch (record[0] % 12) {
      case 0:
        SayAnything(index, record);
        break;
      case 1:
        SayAnAnswer(index, record);
        break;
      case 2:
        Order(ApplyCommand{"fuzz", Targets(record), (record[3] & 1u) != 0});
        break;
      case 3:
        Order(record[3] % 2 == 0 ? StopCommand{} : StopCommand{PositionerIndex{index}});
        break;
      case 4:
        Order(HomeCommand{{{index}}, (record[3] & 1u) != 0});
        break;
      case 5:
        Order(EnableCommand{{{index}}, (record[3] & 1u) != 0, "fuzz"});
        break;
      case 6:
        Order(AdoptCommand{{index}});
        break;
      case 7:
        Order(WriteParameterCommand{{index},
                                    static_cast<Axis>(record[3] % 2),
                                    static_cast<Parameter>(record[4] % kParameterCount),
                                    record[5] * 64});
        break;
      case 8:
        Order(RetargetCommand{{index}, *Targets(record)[index]});
        break;
      case 9:
        Misbehave(&fake_units_[index], record);
        break;
      case 10:
        links_.push_back(
            {layout_.units()[index].bus, static_cast<LinkState>(record[3] % 4), "fuzz"});
        break;
      default:
        if (record[3] % 4 == 0)
          Restart();
        else
          store_fails_ = record[3] % 4 == 1;
    }
    Pass(Milliseconds(std::int64_t{1} << (record[2] % 14)));
  }

 private:
  void Restart() {
    committed_ = 0;
    commits_.clear();
    refused_.clear();
    commands_.clear();
    plans_.clear();
    heard_.clear();
    coordinator_ = std::make_unique<Coordinator>(&layout_, std::vector<UnitDrive>(kUnits),
                                                 CoordinatorConfig{}, store_.fleet);
    wake_at_ = now_;
  }

  template <class What>
  void Order(What what) {
    commands_.push_back({++request_, std::move(what)});
  }

  static std::vector<std::optional<Pose>> Targets(const std::uint8_t* record) {
    std::vector<std::optional<Pose>> targets;
    for (std::uint32_t n = 0; n < kUnits; ++n)
      targets.emplace_back(Pose{(record[4 + 2 * n] - 128) * 300, record[5 + 2 * n] * 300});
    return targets;
  }

  void Misbehave(FakeUnit* fake_unit, const std::uint8_t* record) {
    switch (record[3] % 8) {
      case 0:
        fake_unit->silent = !fake_unit->silent;
        break;
      case 1:
        fake_unit->serial = {100u + record[4] % 5};
        break;
      case 2:
        fake_unit->interrupted = fake_unit->restarted = true;
        fake_unit->state = UnitState::kRest;
        break;
      case 3:
        fake_unit->position[record[4] % 2] += record[5] - 128;
        break;
      case 4:
        fake_unit->state = static_cast<UnitState>(record[4] % kUnitStateCount);
        break;
      case 5:
        fake_unit->keeps_done = !fake_unit->keeps_done;
        break;
      case 6:
        fake_unit->subdivision = record[4] % 2 == 0 ? 96 : 192;
        break;
      default:
        fake_unit->counter1 = 400 + record[4];
    }
  }

  /// Sends any identifier bits and bytes, on any bus.
  void SayAnything(std::uint32_t index, const std::uint8_t* record) {
    CanFrame frame;
    std::memcpy(&frame.id, record + 4, 4);
    frame.id &= kCanIdMax;
    frame.length = record[3] % 9;
    std::memcpy(frame.data.data(), record + 4, 8);
    heard_.push_back({layout_.units()[index].bus, now_, frame});
  }
  /// Sends a function's own form, with the sequence number that the host waits for, and any bytes.
  void SayAnAnswer(std::uint32_t index, const std::uint8_t* record) {
    const auto function = static_cast<Function>(record[3] % kFunctionCount);
    const std::uint8_t sequence = (record[3] & 0x40u) != 0 ? 0 : fake_units_[index].asked;
    constexpr std::uint8_t kLengths[] = {0, 5, 8, 4, 3, 5, 8, 8, 3, 8, 8, 8, 6, 8, 6, 6};
    CanFrame frame{Pack({function,
                         true,
                         {fake_units_[index].node, sequence},
                         static_cast<std::uint8_t>(record[3] >> 4 & 3u)}),
                   kLengths[static_cast<std::size_t>(function) % std::size(kLengths)],
                   {}};
    std::memcpy(frame.data.data(), record + 4, frame.length);
    heard_.push_back({layout_.units()[index].bus, now_, frame});
  }

  void Pass(DurationNs time) {
    const HostInstant end = now_ + time;
    for (int step = 0; step < kStepsPerRecord; ++step) {
      Step();
      HostInstant next = heard_.empty() && plans_.empty() && commits_.empty()
                             ? std::max(wake_at_, now_ + Microseconds(200))
                             : now_ + Microseconds(200);
      if (next > end) break;
      now_ = next;
    }
    now_ = std::max(now_, end);
  }

  void Step() {
    std::vector<PlanDone> plans;
    plans.swap(plans_);
    std::vector<ReceivedFrame> heard;
    heard.swap(heard_);
    ++step_;
    while (!store_fails_ && !commits_.empty() && commits_.front().due <= step_) {
      for (RefusedRow& row : store_.CommitAllBut(commits_.front().batch, commits_.front().rows))
        refused_.push_back(std::move(row));
      committed_ = commits_.front().batch;
      commits_.erase(commits_.begin());
    }
    Effects effects;
    coordinator_->Step({.now = now_,
                        .frames = heard,
                        .links = links_,
                        .commands = commands_,
                        .plans = plans,
                        .committed_through = committed_,
                        .store_failing = store_fails_,
                        .refused = refused_},
                       &effects);
    refused_.clear();
    links_.clear();
    commands_.clear();
    if (!effects.rows.empty())
      commits_.push_back({effects.batch, effects.rows, step_ + kCommitSteps});
    if (effects.plan_job)
      plans_.push_back(RunPlanJob(*effects.plan_job, layout_, coordinator_->drives()));
    for (const OutFrame& out : effects.frames) Deliver(out);
    wake_at_ = effects.wake_at;
  }

  void Deliver(const OutFrame& out) {
    const auto message = DecodeHost(out.frame);
    FOCALFLEET_CHECK(message.has_value());
    const NodeId node = message->address.node;
    FOCALFLEET_CHECK(node == kBroadcastNode || layout_.Find(out.bus, node));
    if (const auto* start = std::get_if<Start>(&message->message)) CheckIntents(out.bus, *start);
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      FakeUnit& fake_unit = fake_units_[n];
      if (layout_.units()[n].bus != out.bus || (node != kBroadcastNode && node != fake_unit.node))
        continue;
      if (node != kBroadcastNode) fake_unit.asked = message->address.sequence;
      for (const UnitMessage& answer : fake_unit.Hear(message->message)) {
        const bool unasked = std::holds_alternative<Start>(message->message) ||
                             (std::holds_alternative<Home>(message->message) &&
                              std::holds_alternative<Done>(answer));
        const std::uint8_t sequence = unasked ? std::uint8_t{0} : message->address.sequence;
        if (!fake_unit.silent)
          heard_.push_back({out.bus, now_, Encode(answer, {fake_unit.node, sequence})});
      }
    }
  }

  void CheckIntents(BusId bus, const Start& start) const {
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const FakeUnit& fake_unit = fake_units_[n];
      if (layout_.units()[n].bus != bus || fake_unit.state != UnitState::kArmed ||
          fake_unit.staged.move != start.move)
        continue;
      bool durable = false;
      for (const IntentRow& intent : store_.begun)
        durable |= intent.unit == layout_.units()[n].id && intent.move == start.move;
      FOCALFLEET_CHECK(durable);
    }
  }

  Layout layout_;
  std::array<FakeUnit, kUnits> fake_units_;
  std::unique_ptr<Coordinator> coordinator_;
  test::MemoryStore store_;
  HostInstant now_{Seconds(1).ns};
  HostInstant wake_at_{0};
  struct Commit {
    std::uint64_t batch;
    std::vector<Row> rows;
    std::uint64_t due;  // in steps
  };
  std::vector<Commit> commits_;
  std::uint64_t step_ = 0;
  std::uint64_t committed_ = 0;
  std::vector<RefusedRow> refused_;
  bool store_fails_ = false;
  std::vector<Command> commands_;
  std::vector<LinkEvent> links_;
  std::vector<PlanDone> plans_;
  std::vector<ReceivedFrame> heard_;
  std::uint64_t request_ = 0;
};

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using focalfleet::kRecord;
  focalfleet::Harness harness;
  for (std::size_t i = 0; i < focalfleet::kRecordsMax && size >= kRecord;
       ++i, data += kRecord, size -= kRecord)
    harness.Do(data);
  return 0;
}
