// In these tests one unit gets another target while the others move, and units that were stopped on
// their way go on. All run on the in-process fleet.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>

#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/rng.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::ExpectStoreTellsTheTruth;
using test::InProcessFleet;
using test::TestSeed;
using test::TruePoses;

constexpr std::uint64_t kRequest = 7000;

class Retargeting {
 public:
  explicit Retargeting(std::uint64_t seed, std::uint32_t count = 37)
      : fleet({.count = count, .units_per_bus = 10, .seed = seed}), seed_(seed) {}

  void Begin() {
    fleet.ApplyRandom(seed_);
    ASSERT_TRUE(fleet.RunUntil(
        [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
        Seconds(60)));
  }
  /// A pose clear of the targets and positions of all other units.
  [[nodiscard]] Pose DrawTarget(PositionerIndex unit, std::uint64_t draw) {
    std::vector<std::optional<Pose>> standing(fleet.layout().size());
    for (std::uint32_t n = 0; n < standing.size(); ++n) {
      const UnitView& view = fleet.coordinator().unit({n});
      if (n != unit.value)
        standing[n] =
            view.target ? *view.target : Pose{view.knowledge[0].low, view.knowledge[1].low};
    }
    const auto drawn = DrawConfiguration(fleet.layout(), fleet.coordinator().drives(), standing,
                                         Rng::Stream(seed_ + draw, "new target"));
    EXPECT_TRUE(drawn) << (drawn ? "" : drawn.error().text);
    return drawn ? (*drawn)[unit.value] : Pose{};
  }
  void Send(PositionerIndex unit, const Pose& target) {
    fleet.Send({kRequest, RetargetCommand{unit, target}});
  }
  /// The `which`-th of the moving units.
  [[nodiscard]] PositionerIndex Moving(std::uint32_t which) {
    std::vector<PositionerIndex> moving;
    for (std::uint32_t n = 0; n < fleet.layout().size(); ++n)
      if (fleet.world().Truth(n).state == UnitState::kMoving) moving.push_back({n});
    EXPECT_FALSE(moving.empty());
    return moving.empty() ? PositionerIndex{0} : moving[which % moving.size()];
  }
  /// Runs until all motion is over. Returns the smallest distance of two arms meanwhile,
  /// half-widths taken off. Units: mm.
  double RunAndSeeNearest() {
    double nearest_mm = 1e9;
    EXPECT_TRUE(fleet.RunUntil(
        [&] {
          if (fleet.now() >= look_at_) {
            look_at_ = fleet.now() + Milliseconds(50);
            nearest_mm = std::min(nearest_mm, Nearest());
          }
          return !fleet.coordinator().busy();
        },
        Seconds(600)));
    fleet.Run(Milliseconds(100));
    return nearest_mm;
  }
  [[nodiscard]] bool IsStopped(PositionerIndex unit) {
    const std::string name = "unit " + std::to_string(fleet.id(unit.value).value) + " is stopped:";
    const auto& alarms = fleet.store().alarms;
    return std::any_of(alarms.begin(), alarms.end(), [&](const AlarmRow& alarm) {
      return alarm.text.find(name) != std::string::npos;
    });
  }

  InProcessFleet fleet;

 private:
  double Nearest() {
    const auto& layout = fleet.layout();
    const std::vector<Pose> poses = TruePoses(fleet);
    const auto arm = [&](std::uint32_t n) {
      return ArmAt(layout.unit({n}), fleet.coordinator().drives()[n], poses[n]);
    };
    double nearest_mm = 1e9;
    for (std::uint32_t n = 0; n < layout.size(); ++n)
      for (const PositionerIndex j : layout.neighbours({n}))
        if (n < j.value)
          nearest_mm = std::min(nearest_mm, DistanceMm(arm(n), arm(j.value)) -
                                                layout.unit({n}).arm_half_width_mm -
                                                layout.unit(j).arm_half_width_mm);
    return nearest_mm;
  }

  std::uint64_t seed_;
  HostInstant look_at_{0};
};

TEST(Retarget, MovingUnitGoesToItsNewTargetAndAllOthersGoOn) {
  int arrived = 0;
  int refused = 0;
  int one_round = 0;
  int draws = 0;
  for (std::uint64_t k = 0; k < 24; ++k) {
    const std::uint64_t seed = TestSeed(500 + k);
    FOCALFLEET_TRACE_SEED(seed);
    Retargeting run(seed);
    ASSERT_NO_FATAL_FAILURE(run.Begin());
    run.fleet.Run(Milliseconds(300 + 400 * static_cast<std::int64_t>(k)));
    const PositionerIndex unit = run.Moving(static_cast<std::uint32_t>(3 * k));
    const Pose target = run.DrawTarget(unit, 1);
    run.Send(unit, target);
    const double nearest_mm = run.RunAndSeeNearest();
    EXPECT_GT(nearest_mm, 0.5 * run.fleet.layout().clearance_mm());
    ++draws;
    const UnitView& view = run.fleet.coordinator().unit(unit);
    const auto reply = run.fleet.LastReply(kRequest);
    ASSERT_TRUE(reply);
    EXPECT_TRUE(reply->last);
    ASSERT_TRUE(IsPlace(view.knowledge));
    if (view.outcome == TargetOutcome::kRefused) {
      ++refused;
      ASSERT_TRUE(reply->error);
      EXPECT_EQ(view.outcome_reason, reply->error->text);
    } else {
      ++arrived;
      EXPECT_EQ(view.outcome, TargetOutcome::kArrived) << view.outcome_reason;
      EXPECT_EQ(PlaceOf(view.knowledge), target);
      EXPECT_FALSE(reply->error) << reply->error->text;
    }
    one_round += run.fleet.coordinator().configuration().round == 1 ? 1 : 0;
    for (std::uint32_t n = 0; n < run.fleet.layout().size(); ++n) {
      if (n == unit.value || run.IsStopped({n})) continue;
      EXPECT_EQ(run.fleet.world().Truth(n).moves_begun, 1u) << n;
      EXPECT_EQ(run.fleet.coordinator().unit({n}).outcome, TargetOutcome::kArrived) << n;
    }
    ExpectStoreTellsTheTruth(run.fleet, "at the end");
    EXPECT_TRUE(run.fleet.store().fleet.open_intents.empty());
    const ConfigurationView& configuration = run.fleet.coordinator().configuration();
    EXPECT_EQ(configuration.counts.targeted, 37u);
    EXPECT_EQ(configuration.counts.arrived, CountOutcome(run.fleet, TargetOutcome::kArrived));
    EXPECT_EQ(configuration.counts.refused, CountOutcome(run.fleet, TargetOutcome::kRefused));
  }
  std::printf("%d new targets: %d arrived, %d refused; %d configurations in one round\n", draws,
              arrived, refused, one_round);
  EXPECT_GE(arrived, draws * 8 / 10);
  EXPECT_GE(one_round, draws / 2);
}

TEST(Retarget, NobodyElseHearsOfIt) {
  // The same fleet runs with and without the retarget: a unit that was not stopped arrives at the
  // same instant.
  const std::uint64_t seed = TestSeed(530);
  FOCALFLEET_TRACE_SEED(seed);
  std::vector<double> ends[2];
  std::vector<std::uint8_t> touched;
  for (const bool with : {false, true}) {
    Retargeting run(seed);
    ASSERT_NO_FATAL_FAILURE(run.Begin());
    run.fleet.Run(Seconds(2));
    const PositionerIndex unit = run.Moving(4);
    if (with) run.Send(unit, run.DrawTarget(unit, 1));
    std::vector<double>& end_s = ends[with ? 1 : 0];
    end_s.assign(run.fleet.layout().size(), 0);
    const HostInstant started = run.fleet.coordinator().configuration().started;
    EXPECT_TRUE(run.fleet.RunUntil(
        [&] {
          for (std::uint32_t n = 0; n < end_s.size(); ++n)
            if (end_s[n] == 0 && run.fleet.world().Truth(n).state != UnitState::kMoving)
              end_s[n] = (run.fleet.now() - started).seconds();
          return !run.fleet.coordinator().busy();
        },
        Seconds(300)));
    touched.assign(end_s.size(), 0);
    for (std::uint32_t n = 0; n < end_s.size(); ++n) touched[n] = run.IsStopped({n}) ? 1 : 0;
  }
  EXPECT_LT(std::count(touched.begin(), touched.end(), 1), 8);
  for (std::size_t n = 0; n < touched.size(); ++n)
    if (touched[n] == 0) {
      EXPECT_NEAR(ends[0][n], ends[1][n], 0.01) << n;
    }
}

TEST(Retarget, UnitAtRestGoes) {
  for (const bool had_target : {true, false}) {
    const std::uint64_t seed = TestSeed(540);
    FOCALFLEET_TRACE_SEED(seed);
    Retargeting run(seed);
    // A unit stays at its position.
    std::vector<std::optional<Pose>> standing(37);
    run.fleet.Run(Seconds(3));
    const UnitKnowledge& stands = run.fleet.coordinator().unit({12}).knowledge;
    ASSERT_TRUE(IsPlace(stands));
    standing[12] = PlaceOf(stands);
    const auto to = DrawConfiguration(run.fleet.layout(), run.fleet.coordinator().drives(),
                                      standing, Rng::Stream(seed, "to"));
    ASSERT_TRUE(to);
    std::vector<std::optional<Pose>> targets(to->begin(), to->end());
    if (!had_target) targets[12].reset();
    run.fleet.Apply(targets);
    ASSERT_TRUE(run.fleet.RunUntil(
        [&] {
          return run.fleet.coordinator().configuration().state == ConfigurationState::kMoving;
        },
        Seconds(60)));
    run.fleet.Run(Seconds(3));
    Pose target{};
    for (std::uint64_t draw = 0; draw < 20; ++draw) {
      target = run.DrawTarget({12}, draw);
      run.Send({12}, target);
      run.fleet.Run(Seconds(4));
      ASSERT_TRUE(run.fleet.LastReply(kRequest));
      if (!run.fleet.LastReply(kRequest)->error) break;
    }
    EXPECT_GT(run.RunAndSeeNearest(), 0.5 * run.fleet.layout().clearance_mm());
    const UnitView& view = run.fleet.coordinator().unit({12});
    EXPECT_EQ(view.outcome, TargetOutcome::kArrived) << view.outcome_reason;
    EXPECT_EQ(PlaceOf(view.knowledge), target);
    EXPECT_EQ(run.fleet.coordinator().configuration().counts.targeted, 37u);
    EXPECT_EQ(CountOutcome(run.fleet, TargetOutcome::kArrived), 37u);
  }
}

TEST(Retarget, WhatCannotBeIsRefusedAndNothingHappens) {
  const std::uint64_t seed = TestSeed(550);
  Retargeting run(seed);
  InProcessFleet& fleet = run.fleet;
  const auto expect = [&](PositionerIndex unit, const Pose& target, ErrorCode code,
                          const std::string& words) {
    run.Send(unit, target);
    fleet.Run(Milliseconds(5));
    const auto reply = fleet.LastReply(kRequest);
    ASSERT_TRUE(reply && reply->error) << words;
    EXPECT_EQ(reply->error->code, code);
    EXPECT_NE(reply->error->text.find(words), std::string::npos) << reply->error->text;
  };
  fleet.Run(Seconds(3));
  expect({4}, {}, ErrorCode::kRefused, "no configuration is under way");
  fleet.ApplyRandom(seed);
  fleet.Run(Milliseconds(5));
  expect({4}, {}, ErrorCode::kRefused, "not moving now");
  ASSERT_NO_FATAL_FAILURE(run.fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  fleet.Run(Seconds(1));
  expect({4}, {1 << 22, 0}, ErrorCode::kInvalid, "outside its axes' ranges");
  // The target is a neighbour's target.
  const auto& layout = fleet.layout();
  const auto drives = fleet.coordinator().drives();
  bool found = false;
  for (const PositionerIndex j : layout.neighbours({4})) {
    const SegmentFp other =
        ArmAt(layout.unit(j), drives[j.value], *fleet.coordinator().unit(j).target);
    const VectorRange theta = RangeOf(layout.unit({4}).theta(), drives[4].axis[0]);
    const VectorRange phi = RangeOf(layout.unit({4}).phi(), drives[4].axis[1]);
    for (std::int32_t a = theta.low; a < theta.high && !found; a += 400)
      for (std::int32_t b = phi.low; b < phi.high && !found; b += 400)
        if (DistanceMm(ArmAt(layout.unit({4}), drives[4], {a, b}), other) < 0.1) {
          found = true;
          expect({4}, {a, b}, ErrorCode::kInvalid,
                 "and the place where unit " + std::to_string(layout.unit(j).id.value) + " ends");
        }
  }
  EXPECT_TRUE(found);
  fleet.world().disturb().PowerCut(fleet.id(9));
  fleet.Run(Seconds(4));
  expect({9}, {}, ErrorCode::kRefused, "does not answer");
  fleet.world().disturb().PowerOn(fleet.id(9));
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({4}).outcome, TargetOutcome::kArrived);
  EXPECT_EQ(fleet.world().Truth(std::size_t{4}).moves_begun, 1u);
}

/// Sends a retarget, and `then` after the time `after`; whatever happens, all units end well.
void Disturb(std::uint64_t seed, DurationNs after,
             const std::function<void(Retargeting*, PositionerIndex)>& then, bool others_arrive) {
  FOCALFLEET_TRACE_SEED(seed);
  SCOPED_TRACE(std::to_string(after.ns / 1'000'000) + " ms after");
  Retargeting run(seed);
  ASSERT_NO_FATAL_FAILURE(run.Begin());
  run.fleet.Run(Seconds(2));
  const PositionerIndex unit = run.Moving(static_cast<std::uint32_t>(seed));
  run.Send(unit, run.DrawTarget(unit, 1));
  run.fleet.Run(after);
  then(&run, unit);
  EXPECT_GT(run.RunAndSeeNearest(), 0);
  run.fleet.Run(Seconds(3));
  for (std::uint32_t n = 0; n < 37; ++n) {
    const sim::UnitTruth truth = run.fleet.world().Truth(n);
    EXPECT_TRUE(!truth.powered || truth.state != UnitState::kMoving) << n;
  }
  ExpectStoreTellsTheTruth(run.fleet, "at the end");
  EXPECT_TRUE(run.fleet.LastReply(kRequest));
  if (!others_arrive) return;
  EXPECT_GE(CountOutcome(run.fleet, TargetOutcome::kArrived), 37u - 5u);
}

TEST(Retarget, StopOfAllAtAnyStageEndsIt) {
  for (int ms = 0; ms < 1500; ms += 60)
    Disturb(
        TestSeed(560), Milliseconds(ms),
        [](Retargeting* run, PositionerIndex) {
          run->fleet.Send({1, StopCommand{}});
        },
        false);
}

TEST(Retarget, StopOfTheUnitAtAnyStageLeavesItKnown) {
  for (int ms = 0; ms < 1500; ms += 100)
    Disturb(
        TestSeed(561), Milliseconds(ms),
        [](Retargeting* run, PositionerIndex unit) {
          run->fleet.Send({1, StopCommand{unit}});
          run->fleet.RunUntilIdle();
          EXPECT_EQ(run->fleet.coordinator().unit(unit).outcome, TargetOutcome::kStopped);
          EXPECT_TRUE(IsPlace(run->fleet.coordinator().unit(unit).knowledge));
        },
        true);
}

TEST(Retarget, AStoppedUnitThatGetsAnotherTargetIsCountedOnce) {
  Retargeting run(TestSeed(570));
  run.Begin();
  run.fleet.Run(Seconds(2));
  const PositionerIndex unit = run.Moving(5);
  run.fleet.Send({1, StopCommand{unit}});
  run.fleet.Run(Milliseconds(300));
  EXPECT_EQ(run.fleet.coordinator().configuration().counts.stopped, 1u);
  run.Send(unit, run.DrawTarget(unit, 1));
  ASSERT_TRUE(run.fleet.RunUntilIdle());
  const ConfigurationView& view = run.fleet.coordinator().configuration();
  EXPECT_EQ(view.counts.stopped, CountOutcome(run.fleet, TargetOutcome::kStopped));
  EXPECT_EQ(view.counts.arrived, CountOutcome(run.fleet, TargetOutcome::kArrived));
  EXPECT_EQ(view.counts.arrived + view.counts.refused + view.counts.failed + view.counts.stopped +
                view.counts.unmeasured,
            view.counts.targeted);
}

TEST(Retarget, UnitThatFallsSilentAtAnyStageIsNamed) {
  for (int ms = 0; ms < 1500; ms += 150)
    Disturb(
        TestSeed(562), Milliseconds(ms),
        [](Retargeting* run, PositionerIndex unit) {
          run->fleet.world().disturb().PowerCut(run->fleet.id(unit.value));
          run->fleet.RunUntilIdle();
          EXPECT_EQ(run->fleet.coordinator().unit(unit).outcome, TargetOutcome::kFailed);
        },
        true);
}

TEST(Retarget, NeighbourThatFailsMeanwhileIsPlannedAround) {
  for (int ms = 0; ms < 1500; ms += 150)
    Disturb(
        TestSeed(563), Milliseconds(ms),
        [](Retargeting* run, PositionerIndex unit) {
          for (const PositionerIndex j : run->fleet.layout().neighbours(unit)) {
            if (run->fleet.world().Truth(j.value).state != UnitState::kMoving) continue;
            run->fleet.Send({1, StopCommand{j}});
            return;
          }
        },
        true);
}

TEST(Retarget, LostFramesAndASlowStoreDelayIt) {
  Disturb(
      TestSeed(564), Milliseconds(0),
      [](Retargeting* run, PositionerIndex) {
        for (const BusId bus : run->fleet.layout().buses())
          run->fleet.world().disturb().faults(bus)->drop = 0.02;
      },
      true);
  Disturb(
      TestSeed(565), Milliseconds(50),
      [](Retargeting* run, PositionerIndex) {
        run->fleet.storage.fails = true;
        run->fleet.Run(Seconds(4));
        run->fleet.storage.fails = false;
      },
      true);
}

TEST(Retarget, UnitThatDoesNotTakeItsMoveIsNamed) {
  Disturb(
      TestSeed(566), Milliseconds(0),
      [](Retargeting* run, PositionerIndex unit) {
        run->fleet.world().disturb().faults(run->fleet.id(unit.value))->wrong_digest = true;
        run->fleet.RunUntilIdle();
        EXPECT_TRUE(run->fleet.LastReply(kRequest)->error);
        EXPECT_EQ(run->fleet.coordinator().unit(unit).outcome, TargetOutcome::kFailed);
      },
      true);
}

TEST(Retarget, KilledAtAnyStageTheStoreTellsTheTruth) {
  for (int ms = 0; ms < 1500; ms += 100) {
    const std::uint64_t seed = TestSeed(567);
    FOCALFLEET_TRACE_SEED(seed);
    SCOPED_TRACE(ms);
    Retargeting run(seed);
    ASSERT_NO_FATAL_FAILURE(run.Begin());
    run.fleet.Run(Seconds(2));
    const PositionerIndex unit = run.Moving(3);
    run.Send(unit, run.DrawTarget(unit, 1));
    run.fleet.Run(Milliseconds(ms));
    run.fleet.Restart();
    run.fleet.Run(Seconds(90));
    ExpectStoreTellsTheTruth(run.fleet, "after the restart");
    EXPECT_TRUE(run.fleet.store().fleet.open_intents.empty());
    run.fleet.ApplyRandom(seed + 1);
    ASSERT_TRUE(run.fleet.RunUntilIdle());
    run.fleet.Run(Milliseconds(100));
    ExpectStoreTellsTheTruth(run.fleet, "after the next configuration");
  }
}

TEST(Retarget, WhoMissedTheStartGoesLateInTheSameRound) {
  int late = 0;
  int draws = 0;
  for (std::uint64_t k = 0; k < 8; ++k) {
    const std::uint64_t seed = TestSeed(570 + k);
    FOCALFLEET_TRACE_SEED(seed);
    Retargeting run(seed);
    run.fleet.ApplyRandom(seed);
    ASSERT_TRUE(run.fleet.RunUntil(
        [&] {
          return run.fleet.coordinator().configuration().state == ConfigurationState::kUploading;
        },
        Seconds(60)));
    ASSERT_TRUE(run.fleet.RunUntil(
        [&] { return run.fleet.coordinator().unit({5}).phase == UnitPhase::kArmed; }, Seconds(5)));
    run.fleet.world().disturb().faults(run.fleet.id(5))->deaf = true;
    ASSERT_TRUE(run.fleet.RunUntil(
        [&] {
          return run.fleet.coordinator().configuration().state == ConfigurationState::kMoving;
        },
        Seconds(5)));
    run.fleet.Run(Milliseconds(350));
    run.fleet.world().disturb().faults(run.fleet.id(5))->deaf = false;
    EXPECT_GT(run.RunAndSeeNearest(), 0.5 * run.fleet.layout().clearance_mm());
    ++draws;
    late += run.fleet.coordinator().configuration().round == 1 ? 1 : 0;
    EXPECT_EQ(run.fleet.coordinator().unit({5}).outcome, TargetOutcome::kArrived)
        << run.fleet.coordinator().unit({5}).outcome_reason;
    ExpectStoreTellsTheTruth(run.fleet, "at the end");
  }
  std::printf("%d of %d went in the same round\n", late, draws);
  EXPECT_GE(late, draws / 2);
}

}  // namespace
}  // namespace focalfleet
