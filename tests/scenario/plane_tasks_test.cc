// Tasks of a plane beside configurations: homing, and other targets for single units. Units at
// borders may be homed, too, because all sectors in their reach take part and stand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/scenario/plane_in_process.h"
#include "tests/scenario/plane_judge.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::PlaneInProcess;

UnitState StateOf(PlaneInProcess* plane, PositionerIndex i) {
  return plane->world().Truth(i.value).state;
}

/// A plane, and the judgement of all that happens in it.
struct Judged {
  explicit Judged(std::uint64_t seed)
      : plane({.sectors = 3, .units_per_sector = 8, .seed = seed, .times = {}, .agent = {}}),
        judge(&plane) {
    plane.commanded = [this](std::uint32_t sector, const SectorAgent& agent,
                             const Command& command) { judge.Commanded(sector, agent, command); };
    plane.looked = [this] {
      judge.Look();
      LookAtHoming();
    };
    EXPECT_TRUE(plane.RunUntil([this] { return plane.IsIdle(); }, Seconds(20)));
    plane.Run(Seconds(5));
  }
  ~Judged() {
    judge.LookAtStores();
    for (const std::string& broken : judge.broken()) ADD_FAILURE() << broken;
  }
  /// Every unit in reach of one that homes stands.
  void LookAtHoming() {
    for (std::uint32_t n = 0; n < plane.layout().layout().size(); ++n) {
      if (StateOf(&plane, {n}) != UnitState::kHoming) continue;
      ++homed;
      for (const PositionerIndex other : plane.layout().layout().neighbours({n})) {
        const UnitState state = StateOf(&plane, other);
        if (state == UnitState::kMoving || state == UnitState::kHoming)
          ADD_FAILURE() << "a unit moves in reach of one that homes";
      }
    }
  }

  PlaneInProcess plane;
  test::PlaneJudge judge;
  std::uint32_t homed = 0;  // looks at which a unit homed
};

bool Finish(PlaneInProcess* plane) {
  return plane->RunUntil([plane] { return !plane->IsIdle(); }, Seconds(5)) &&
         plane->RunUntil([plane] { return plane->IsIdle(); }, Seconds(600));
}
bool RunUntilIn(PlaneInProcess* plane, PositionerIndex i, UnitState state) {
  return plane->RunUntil([&] { return StateOf(plane, i) == state; }, Seconds(100));
}
/// A unit of the sector that one of another sector can reach.
PositionerIndex AtBorder(const PlaneInProcess& plane, std::uint32_t sector) {
  const auto own = plane.layout().own(sector);
  return *std::ranges::find_if(
      own, [&](PositionerIndex i) { return !plane.layout().beyond(i).empty(); });
}
/// The unit loses its place: its power is cut in mid-move.
void Lose(PlaneInProcess* plane, PositionerIndex i, std::uint64_t seed) {
  const UnitId id = plane->layout().layout().unit(i).id;
  plane->Apply(plane->DrawTargets(seed));
  ASSERT_TRUE(RunUntilIn(plane, i, UnitState::kMoving));
  plane->Run(Seconds(1));
  plane->world().disturb().PowerCut(id);
  plane->Run(Seconds(3));
  plane->world().disturb().PowerOn(id);
  ASSERT_TRUE(plane->RunUntil([plane] { return plane->IsIdle(); }, Seconds(400)));
  plane->Run(Seconds(10));
  ASSERT_FALSE(IsPlace(plane->unit(i).knowledge));
}

TEST(PlaneTasks, AUnitAtABorderIsHomed) {
  std::uint32_t without_way = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    Judged judged(seed);
    PlaneInProcess& plane = judged.plane;
    const PositionerIndex lost = AtBorder(plane, 1);
    Lose(&plane, lost, seed);
    const std::uint64_t request = plane.Give(PlaneHomeCommand{{lost}});
    ASSERT_TRUE(Finish(&plane));
    const PlaneView& view = plane.plane().view();
    EXPECT_EQ(view.kind, ConfigurationKind::kHome);
    // Some plates leave no room to step aside; then nothing moves.
    if (view.state == ConfigurationState::kFailed) {
      EXPECT_NE(plane.unit(lost).outcome_reason.find("cannot home"), std::string::npos);
      EXPECT_EQ(judged.homed, 0u);
      ++without_way;
      continue;
    }
    EXPECT_EQ(view.state, ConfigurationState::kDone);
    EXPECT_EQ(view.counts.targeted, 1u);
    EXPECT_EQ(view.counts.arrived, 1u) << plane.unit(lost).outcome_reason;
    EXPECT_GT(judged.homed, 0u);
    ASSERT_NE(plane.ReplyTo(request), nullptr);
    EXPECT_FALSE(plane.ReplyTo(request)->error);
    EXPECT_TRUE(IsPlace(plane.unit(lost).knowledge));
    const auto targets = plane.DrawTargets(100 + seed);
    plane.Apply(targets);
    ASSERT_TRUE(Finish(&plane));
    EXPECT_EQ(plane.plane().view().counts.arrived, targets.size());
  }
  EXPECT_LE(without_way, 1u);
}

// Neighbours home one after the other, and others make way for them over borders.
TEST(PlaneTasks, AllUnitsAreHomed) {
  Judged judged(4);
  PlaneInProcess& plane = judged.plane;
  PlaneHomeCommand home;
  for (std::uint32_t n = 0; n < plane.layout().layout().size(); ++n) home.units.push_back({n});
  plane.Give(home);
  ASSERT_TRUE(Finish(&plane));
  EXPECT_EQ(plane.plane().view().state, ConfigurationState::kDone);
  EXPECT_EQ(plane.plane().view().counts.arrived, home.units.size());
}

TEST(PlaneTasks, AUnitBesideASectorThatIsNotThereIsNotHomed) {
  Judged judged(2);
  PlaneInProcess& plane = judged.plane;
  const PositionerIndex unit = AtBorder(plane, 0);
  plane.KillSector(plane.layout().beyond(unit)[0]);
  plane.Run(Seconds(5));
  plane.Give(PlaneHomeCommand{{unit}});
  ASSERT_TRUE(Finish(&plane));
  EXPECT_EQ(judged.homed, 0u);
  EXPECT_EQ(plane.unit(unit).outcome, TargetOutcome::kRefused);
  EXPECT_EQ(plane.unit(unit).outcome_reason, "a sector in its reach takes no part");
  // Units of the sector that is not there are refused at once.
  const auto missing = plane.layout().own(plane.layout().beyond(unit)[0])[0];
  const std::uint64_t request = plane.Give(PlaneHomeCommand{{missing}});
  plane.Run(Seconds(1));
  ASSERT_NE(plane.ReplyTo(request), nullptr);
  EXPECT_TRUE(plane.ReplyTo(request)->error);
  plane.StartSector(plane.layout().beyond(unit)[0]);
  plane.Run(Seconds(10));
}

TEST(PlaneTasks, HomingGoesOnAfterAKillOfTheCoordinatorOrTheSector) {
  for (const bool of_sector : {false, true}) {
    Judged judged(3);
    PlaneInProcess& plane = judged.plane;
    const PositionerIndex unit = AtBorder(plane, 1);
    plane.Give(PlaneHomeCommand{{unit}});
    ASSERT_TRUE(RunUntilIn(&plane, unit, UnitState::kHoming));
    plane.Run(Seconds(1));
    if (of_sector) plane.KillSector(1);
    if (!of_sector) plane.KillPlane();
    plane.Run(Seconds(2));
    if (of_sector) plane.StartSector(1);
    if (!of_sector) plane.StartPlane();
    ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(400)));
    plane.Run(Seconds(10));
    EXPECT_EQ(plane.plane().view().counts.arrived, 1u) << of_sector;
    EXPECT_TRUE(IsPlace(plane.unit(unit).knowledge));
  }
}

TEST(PlaneTasks, AStopEndsHoming) {
  Judged judged(5);
  PlaneInProcess& plane = judged.plane;
  const PositionerIndex unit = AtBorder(plane, 1);
  plane.Give(PlaneHomeCommand{{unit}});
  ASSERT_TRUE(RunUntilIn(&plane, unit, UnitState::kHoming));
  plane.Run(Seconds(1));
  plane.Stop();
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(30)));
  EXPECT_EQ(plane.plane().view().state, ConfigurationState::kStopped);
  plane.Run(Seconds(2));
  EXPECT_NE(StateOf(&plane, unit), UnitState::kHoming);
}

/// The unit's arm is at `pose`.
bool IsAt(PlaneInProcess* plane, PositionerIndex i, const Pose& pose) {
  constexpr double kLagVectors = 6;
  const sim::UnitTruth truth = plane->world().Truth(i.value);
  return std::ranges::all_of(kAxes, [&](Axis axis) {
    return std::abs(truth.vectors[Index(axis)] - pose[Index(axis)]) <= kLagVectors;
  });
}

TEST(PlaneTasks, AUnitGoesToAnotherTargetInTheNextRound) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    Judged judged(seed);
    PlaneInProcess& plane = judged.plane;
    const PositionerIndex unit = AtBorder(plane, 1);
    const auto targets = plane.DrawTargets(seed);
    // The place where the unit stands is free in any configuration of the others that leads there.
    const Pose other = PlaceOf(plane.unit(unit).knowledge);
    plane.Apply(targets);
    ASSERT_TRUE(RunUntilIn(&plane, unit, UnitState::kMoving));
    plane.Run(Seconds(2));
    const std::uint64_t request = plane.Give(PlaneRetargetCommand{unit, other});
    plane.Run(Seconds(1));
    ASSERT_NE(plane.ReplyTo(request), nullptr);
    EXPECT_FALSE(plane.ReplyTo(request)->error);
    ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(400)));
    const PlaneView& view = plane.plane().view();
    EXPECT_EQ(view.rounds, 2u);
    const UnitView& end = plane.unit(unit);
    EXPECT_EQ(end.target, other);
    // Another unit may stand in its way by then; it is refused then, and stays where it is.
    if (end.outcome == TargetOutcome::kArrived)
      EXPECT_TRUE(IsAt(&plane, unit, other));
    else
      EXPECT_EQ(end.outcome, TargetOutcome::kRefused) << end.outcome_reason;
    EXPECT_EQ(view.counts.arrived + view.counts.refused, targets.size());
  }
}

TEST(PlaneTasks, OtherTargetsAreNotForgottenWithAKill) {
  Judged judged(6);
  PlaneInProcess& plane = judged.plane;
  const PositionerIndex unit = AtBorder(plane, 1);
  const auto targets = plane.DrawTargets(6);
  const Pose other = PlaceOf(plane.unit(unit).knowledge);
  plane.Apply(targets);
  ASSERT_TRUE(RunUntilIn(&plane, unit, UnitState::kMoving));
  plane.Run(Seconds(2));
  const std::uint64_t request = plane.Give(PlaneRetargetCommand{unit, other});
  ASSERT_TRUE(plane.RunUntil([&] { return plane.ReplyTo(request) != nullptr; }, Seconds(5)));
  plane.KillPlane();
  plane.KillSector(1);
  plane.Run(Seconds(1));
  plane.StartPlane();
  plane.StartSector(1);
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(400)));
  EXPECT_EQ(plane.unit(unit).target, other);
  EXPECT_NE(plane.unit(unit).outcome, TargetOutcome::kPending);
}

// A sector that hears of a configuration only after the stop has refused nothing.
TEST(PlaneTasks, AStopBeforeASectorHasItsTaskIsAStopThere) {
  Judged judged(8);
  PlaneInProcess& plane = judged.plane;
  plane.KillSector(1);
  plane.Run(Seconds(1));
  plane.Apply(plane.DrawTargets(8));
  plane.Run(Seconds(1));
  plane.Stop();
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(30)));
  plane.StartSector(1);
  plane.Run(Seconds(15));
  for (const PositionerIndex i : plane.layout().own(1)) {
    EXPECT_EQ(plane.unit(i).outcome, TargetOutcome::kStopped);
    EXPECT_EQ(plane.unit(i).outcome_reason, "the configuration was stopped");
  }
  EXPECT_EQ(plane.plane().view().counts.stopped, plane.plane().view().counts.targeted);
}

TEST(PlaneTasks, NoOtherTargetsWithoutAConfiguration) {
  Judged judged(7);
  PlaneInProcess& plane = judged.plane;
  const std::uint64_t request = plane.Give(PlaneRetargetCommand{{3}, {1, 1}});
  plane.Run(Seconds(1));
  ASSERT_NE(plane.ReplyTo(request), nullptr);
  ASSERT_TRUE(plane.ReplyTo(request)->error);
  EXPECT_EQ(plane.ReplyTo(request)->error->text, "no configuration is under way: apply one");
}

}  // namespace
}  // namespace focalfleet
