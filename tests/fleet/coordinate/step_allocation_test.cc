// Coordinator::Step promises to allocate nothing while units are asked, heard and polled alone. The
// units here answer at once, and never end a motion, so a fleet at rest and a fleet in motion can
// be polled for as long as it takes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <variant>
#include <vector>

#include "fleet/coordinator.h"
#include "fleet/plan/job.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/staged_move.h"
#include "tests/fleet/plan/planning.h"
#include "tests/support/alloc_guard.h"

namespace focalfleet {
namespace {

using test::FleetOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::UnitAt;

constexpr std::uint32_t kUnits = 8;
constexpr double kPitch_mm = 40;  // out of each other's reach
constexpr BusId kBus{1};

/// A unit that holds a move, begins it, and never ends it.
class EndlessUnit {
 public:
  EndlessUnit(std::uint32_t number, const UnitDrive& drive) : number_(number), drive_(drive) {}

  [[nodiscard]] NodeId node() const { return NodeId{static_cast<std::uint8_t>(number_ + 1)}; }

  /// Appends the answer, if there is one.
  void Hear(const CanFrame& frame, HostInstant now, std::vector<ReceivedFrame>* answers) {
    const auto heard = DecodeHost(frame);
    ASSERT_TRUE(heard);
    if (heard->address.node != node() && heard->address.node != kBroadcastNode) return;
    const auto answer = [&](const UnitMessage& message) {
      answers->push_back({kBus, now, Encode(message, {node(), heard->address.sequence})});
    };
    if (std::holds_alternative<IdentifyRequest>(heard->message)) {
      answer(IdentifyReply{.serial = SerialNumber{1000 + number_}});
    } else if (std::holds_alternative<StatusRequest>(heard->message)) {
      answer(StatusReply{.state = state_, .move = begun_});
    } else if (const auto* vector = std::get_if<VectorRequest>(&heard->message)) {
      answer(VectorReply{vector->axis, 0,
                         static_cast<std::uint16_t>(drive_.axis[Index(vector->axis)].subdivision),
                         0});
    } else if (const auto* read = std::get_if<ParameterRead>(&heard->message)) {
      answer(ParameterReply{.axis = read->axis,
                            .parameter = read->parameter,
                            .value = drive_.axis[Index(read->axis)].counter1});
    } else if (std::holds_alternative<ClockRequest>(heard->message)) {
      answer(ClockReply{static_cast<std::uint32_t>(now.ns / kTick.ns), 0});
    } else {
      HearOfMove(heard->message, answer);
    }
  }

 private:
  template <class Answer>
  void HearOfMove(const HostMessage& message, const Answer& answer) {
    if (const auto* begin = std::get_if<StageBegin>(&message)) {
      staged_ = {.move = begin->move, .mode = begin->mode, .path = {}};
    } else if (const auto* segment = std::get_if<StageSegment>(&message)) {
      staged_.path[Index(segment->axis)].Append(segment->segment);
    } else if (std::holds_alternative<Confirm>(message)) {
      answer(ConfirmReply{.move = staged_.move,
                          .digest = Digest(staged_),
                          .segments = {staged_.path[0].size(), staged_.path[1].size()}});
    } else if (std::holds_alternative<Arm>(message)) {
      answer(ArmReply{.move = staged_.move});
    } else if (std::holds_alternative<ProgressRequest>(message)) {
      answer(ProgressReply{.state = UnitState::kArmed, .position = {0, 0}, .move = begun_});
    } else if (const auto* start = std::get_if<Start>(&message)) {
      if (start->move != staged_.move) return;
      begun_ = start->move;
      state_ = UnitState::kMoving;
    }
  }

  std::uint32_t number_;
  const UnitDrive& drive_;
  StagedMove staged_;
  MoveId begun_;
  UnitState state_ = UnitState::kRest;
};

/// A coordinator with its units, a planner, and a store that keeps everything at once.
class PolledFleet {
 public:
  PolledFleet()
      : fleet_(FleetOf(Units())), coordinator_(&fleet_.layout, fleet_.drives, config_, {}) {
    for (std::uint32_t n = 0; n < kUnits; ++n) units_.emplace_back(n, fleet_.drives[n]);
  }

  void Apply() {
    ApplyCommand apply{.source = "test", .targets = {}};
    for (std::uint32_t n = 0; n < kUnits; ++n)
      apply.targets.emplace_back(PoseDeg(fleet_, n, 90, 30));
    commands_.push_back({.request = 1, .what = std::move(apply)});
  }

  struct Steps {
    std::uint64_t steps = 0;
    std::uint64_t frames = 0;       // both directions
    std::uint64_t allocations = 0;  // within Step
  };
  Steps Run(DurationNs duration) {
    Steps run;
    for (const HostInstant end = now_ + duration; now_ < end;) {
      effects_.Clear();
      const test::AllocGuard guard;
      coordinator_.Step({.now = now_,
                         .frames = heard_,
                         .links = {},
                         .commands = commands_,
                         .plans = plans_,
                         .committed_through = committed_through_},
                        &effects_);
      run.allocations += guard.allocations();
      ++run.steps;
      run.frames += heard_.size() + effects_.frames.size();
      Perform();
    }
    return run;
  }

  [[nodiscard]] bool All(UnitPhase phase) const {
    for (std::uint32_t n = 0; n < kUnits; ++n)
      if (coordinator_.unit({n}).phase != phase) return false;
    return true;
  }

 private:
  static std::vector<Unit> Units() {
    std::vector<Unit> units;
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      units.push_back(UnitAt(n + 1, n * kPitch_mm));
      units.back().bus = kBus;
      units.back().node = NodeId{static_cast<std::uint8_t>(n + 1)};
    }
    return units;
  }

  void Perform() {
    heard_.clear();
    commands_.clear();
    plans_.clear();
    if (effects_.batch != 0) committed_through_ = effects_.batch;
    if (effects_.plan_job)
      plans_.push_back(RunPlanJob(*effects_.plan_job, fleet_.layout, fleet_.drives));
    const HostInstant later = now_ + Milliseconds(1);
    for (const OutFrame& out : effects_.frames)
      for (EndlessUnit& unit : units_) unit.Hear(out.frame, later, &heard_);
    const bool waits = heard_.empty() && plans_.empty() && effects_.batch == 0;
    now_ = waits ? std::max(later, effects_.wake_at) : later;
  }

  PlanningFleet fleet_;
  CoordinatorConfig config_;
  Coordinator coordinator_;
  std::vector<EndlessUnit> units_;
  HostInstant now_{Seconds(1).ns};
  std::uint64_t committed_through_ = 0;
  std::vector<ReceivedFrame> heard_;
  std::vector<Command> commands_;
  std::vector<PlanDone> plans_;
  Effects effects_;
};

TEST(CoordinatorStep, AllocatesNothingForAWarmedUpFleetAtRest) {
  PolledFleet fleet;
  fleet.Run(Seconds(60));
  ASSERT_TRUE(fleet.All(UnitPhase::kReady));
  const PolledFleet::Steps polled = fleet.Run(Seconds(600));
  EXPECT_EQ(polled.allocations, 0u);
  EXPECT_GE(polled.steps, 600u);
  EXPECT_GE(polled.frames, 59u * kUnits * 4) << "status and clock of each unit every ten seconds";
}

TEST(CoordinatorStep, AllocatesNothingForAWarmedUpFleetThatIsPolledInMotion) {
  PolledFleet fleet;
  fleet.Run(Seconds(30));
  fleet.Apply();
  fleet.Run(Seconds(60));
  ASSERT_TRUE(fleet.All(UnitPhase::kMoving));
  const PolledFleet::Steps polled = fleet.Run(Seconds(600));
  ASSERT_TRUE(fleet.All(UnitPhase::kMoving));
  EXPECT_EQ(polled.allocations, 0u);
  EXPECT_GE(polled.frames, 599u * kUnits * 2) << "status of each unit every second";
}

TEST(CoordinatorStep, AllocatesForAConfiguration) {
  PolledFleet fleet;
  fleet.Run(Seconds(30));
  fleet.Apply();
  EXPECT_GT(fleet.Run(Seconds(1)).allocations, 0u) << "rows, replies, the plan";
}

}  // namespace
}  // namespace focalfleet
