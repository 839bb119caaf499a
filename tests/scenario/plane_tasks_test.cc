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

/// A plane, and what a judge says of all that happens in it.
class JudgedPlane : public PlaneInProcess {
 public:
  explicit JudgedPlane(std::uint64_t seed)
      : PlaneInProcess(
            {.sectors = 3, .units_per_sector = 8, .seed = seed, .times = {}, .agent = {}}),
        judge_(this) {
    commanded = [this](std::uint32_t sector, const SectorAgent& agent, const Command& command) {
      judge_.Commanded(sector, agent, command);
    };
    looked = [this] {
      judge_.Look();
      LookAtHoming();
    };
    EXPECT_TRUE(RunUntil([this] { return IsIdle(); }, Seconds(20)));
    Run(Seconds(5));
  }
  ~JudgedPlane() {
    judge_.LookAtStores();
    for (const std::string& broken : judge_.broken()) ADD_FAILURE() << broken;
  }

  bool Finish() {
    return RunUntil([this] { return !IsIdle(); }, Seconds(5)) &&
           RunUntil([this] { return IsIdle(); }, Seconds(600));
  }
  /// A unit of the sector that one of another sector can reach.
  PositionerIndex AtBorder(std::uint32_t sector) const {
    const auto own = layout().own(sector);
    const auto it = std::ranges::find_if(
        own, [this](PositionerIndex i) { return !layout().beyond(i).empty(); });
    return *it;
  }
  [[nodiscard]] UnitState StateOf(PositionerIndex i) { return world().Truth(i.value).state; }
  bool RunUntilIn(PositionerIndex i, UnitState state, DurationNs limit = Seconds(100)) {
    return RunUntil([&] { return StateOf(i) == state; }, limit);
  }
  /// The unit loses its place: its power is cut in mid-move.
  void Lose(PositionerIndex i, std::uint64_t seed) {
    const UnitId id = layout().layout().unit(i).id;
    Apply(DrawTargets(seed));
    ASSERT_TRUE(RunUntilIn(i, UnitState::kMoving));
    Run(Seconds(1));
    world().disturb().PowerCut(id);
    Run(Seconds(3));
    world().disturb().PowerOn(id);
    ASSERT_TRUE(RunUntil([this] { return IsIdle(); }, Seconds(400)));
    Run(Seconds(10));
    ASSERT_FALSE(IsPlace(unit(i).knowledge));
  }

  std::uint32_t homed = 0;  // looks at which a unit homed

 private:
  /// Every unit in reach of one that homes stands.
  void LookAtHoming() {
    const auto state = [this](PositionerIndex i) { return world().Truth(i.value).state; };
    for (std::uint32_t n = 0; n < layout().layout().size(); ++n) {
      if (state({n}) != UnitState::kHoming) continue;
      ++homed;
      for (const PositionerIndex other : layout().layout().neighbours({n}))
        if (state(other) == UnitState::kMoving || state(other) == UnitState::kHoming)
          ADD_FAILURE() << "a unit moves in reach of one that homes";
    }
  }

  test::PlaneJudge judge_;
};

TEST(PlaneTasks, AUnitAtABorderIsHomed) {
  std::uint32_t without_way = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    JudgedPlane plane(seed);
    const PositionerIndex lost = plane.AtBorder(1);
    plane.Lose(lost, seed);
    const std::uint64_t request = plane.Give(PlaneHomeCommand{{lost}});
    ASSERT_TRUE(plane.Finish());
    const PlaneView& view = plane.plane().view();
    EXPECT_EQ(view.kind, ConfigurationKind::kHome);
    // Some plates leave no room to step aside; then nothing moves.
    if (view.state == ConfigurationState::kFailed) {
      EXPECT_NE(plane.unit(lost).outcome_reason.find("cannot home"), std::string::npos);
      EXPECT_EQ(plane.homed, 0u);
      ++without_way;
      continue;
    }
    EXPECT_EQ(view.state, ConfigurationState::kDone);
    EXPECT_EQ(view.counts.targeted, 1u);
    EXPECT_EQ(view.counts.arrived, 1u) << plane.unit(lost).outcome_reason;
    EXPECT_GT(plane.homed, 0u);
    ASSERT_NE(plane.ReplyTo(request), nullptr);
    EXPECT_FALSE(plane.ReplyTo(request)->error);
    EXPECT_TRUE(IsPlace(plane.unit(lost).knowledge));
    const auto targets = plane.DrawTargets(100 + seed);
    plane.Apply(targets);
    ASSERT_TRUE(plane.Finish());
    EXPECT_EQ(plane.plane().view().counts.arrived, targets.size());
  }
  EXPECT_LE(without_way, 1u);
}

// Neighbours home one after the other, and others make way for them over borders.
TEST(PlaneTasks, AllUnitsAreHomed) {
  JudgedPlane plane(4);
  PlaneHomeCommand home;
  for (std::uint32_t n = 0; n < plane.layout().layout().size(); ++n) home.units.push_back({n});
  plane.Give(home);
  ASSERT_TRUE(plane.Finish());
  EXPECT_EQ(plane.plane().view().state, ConfigurationState::kDone);
  EXPECT_EQ(plane.plane().view().counts.arrived, home.units.size());
}

TEST(PlaneTasks, AUnitBesideASectorThatIsNotThereIsNotHomed) {
  JudgedPlane plane(2);
  const PositionerIndex unit = plane.AtBorder(0);
  plane.KillSector(plane.layout().beyond(unit)[0]);
  plane.Run(Seconds(5));
  plane.Give(PlaneHomeCommand{{unit}});
  ASSERT_TRUE(plane.Finish());
  EXPECT_EQ(plane.homed, 0u);
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
    JudgedPlane plane(3);
    const PositionerIndex unit = plane.AtBorder(1);
    plane.Give(PlaneHomeCommand{{unit}});
    ASSERT_TRUE(plane.RunUntilIn(unit, UnitState::kHoming));
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
  JudgedPlane plane(5);
  const PositionerIndex unit = plane.AtBorder(1);
  plane.Give(PlaneHomeCommand{{unit}});
  ASSERT_TRUE(plane.RunUntilIn(unit, UnitState::kHoming));
  plane.Run(Seconds(1));
  plane.Stop();
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(30)));
  EXPECT_EQ(plane.plane().view().state, ConfigurationState::kStopped);
  plane.Run(Seconds(2));
  EXPECT_NE(plane.StateOf(unit), UnitState::kHoming);
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
    JudgedPlane plane(seed);
    const PositionerIndex unit = plane.AtBorder(1);
    const auto targets = plane.DrawTargets(seed);
    // The place where the unit stands is free in any configuration of the others that leads there.
    const Pose other = PlaceOf(plane.unit(unit).knowledge);
    plane.Apply(targets);
    ASSERT_TRUE(plane.RunUntilIn(unit, UnitState::kMoving));
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
    // Another unit may stand in its way by then; it is told so, and stays where it is.
    if (end.outcome == TargetOutcome::kArrived)
      EXPECT_TRUE(IsAt(&plane, unit, other));
    else
      EXPECT_EQ(end.outcome, TargetOutcome::kRefused) << end.outcome_reason;
    EXPECT_EQ(view.counts.arrived + view.counts.refused, targets.size());
  }
}

TEST(PlaneTasks, OtherTargetsAreNotForgottenWithAKill) {
  JudgedPlane plane(6);
  const PositionerIndex unit = plane.AtBorder(1);
  const auto targets = plane.DrawTargets(6);
  const Pose other = PlaceOf(plane.unit(unit).knowledge);
  plane.Apply(targets);
  ASSERT_TRUE(plane.RunUntilIn(unit, UnitState::kMoving));
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

TEST(PlaneTasks, NoOtherTargetsWithoutAConfiguration) {
  JudgedPlane plane(7);
  const std::uint64_t request = plane.Give(PlaneRetargetCommand{{3}, {1, 1}});
  plane.Run(Seconds(1));
  ASSERT_NE(plane.ReplyTo(request), nullptr);
  ASSERT_TRUE(plane.ReplyTo(request)->error);
  EXPECT_EQ(plane.ReplyTo(request)->error->text, "no configuration is under way: apply one");
}

}  // namespace
}  // namespace focalfleet
