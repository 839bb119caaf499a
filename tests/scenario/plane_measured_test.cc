// A plane's camera looks at the units of all sectors at once, and each sector corrects its own in
// rounds of the plane.
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/kinematics.h"
#include "tests/scenario/plane_in_process.h"
#include "tests/scenario/plane_judge.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::PlaneInProcess;

PlaneInProcess::Options Measured(std::uint64_t seed) {
  return {.sectors = 3,
          .units_per_sector = 8,
          .seed = seed,
          .times = {},
          .agent = {},
          .spread = sim::Spread::kReal};
}

/// Units: um. The distance of the unit's fibre from its target.
double ErrorUm(PlaneInProcess* plane, PositionerIndex i, const Pose& target) {
  const sim::UnitTruth truth = plane->world().Truth(i.value);
  const PointFp aim = FibreAt(plane->layout().layout().unit(i), UnitDrive{}, target);
  return 1e3 * std::hypot(truth.x_mm - aim.x_mm, truth.y_mm - aim.y_mm);
}

/// A plane, and the judgement of all that happens in it.
struct Judged {
  explicit Judged(std::uint64_t seed) : plane(Measured(seed)), judge(&plane) {
    plane.commanded = [this](std::uint32_t sector, const SectorAgent& agent,
                             const Command& command) { judge.Commanded(sector, agent, command); };
    plane.looked = [this] { judge.Look(); };
    EXPECT_TRUE(plane.RunUntil([this] { return plane.IsIdle(); }, Seconds(20)));
    plane.Run(Seconds(5));
  }
  ~Judged() {
    for (const std::string& broken : judge.broken()) ADD_FAILURE() << broken;
  }
  PlaneInProcess plane;
  test::PlaneJudge judge;
};

void ApplyMeasured(PlaneInProcess* plane, const std::vector<std::optional<Pose>>& targets,
                   std::uint8_t corrections) {
  plane->Give(
      PlaneApplyCommand{"test", false, targets, {}, ApplyCommand::Measure{corrections, 10, false}});
}
bool Finish(PlaneInProcess* plane) {
  return plane->RunUntil([plane] { return !plane->IsIdle(); }, Seconds(5)) &&
         plane->RunUntil([plane] { return plane->IsIdle(); }, Seconds(2000));
}

TEST(MeasuredPlane, CorrectsItsUnitsInRoundsOfThePlane) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    Judged judged(seed);
    PlaneInProcess& plane = judged.plane;
    const auto targets = plane.DrawTargets(seed);
    ApplyMeasured(&plane, targets, 2);
    ASSERT_TRUE(Finish(&plane));
    const PlaneView& view = plane.plane().view();
    EXPECT_EQ(view.state, ConfigurationState::kDone);
    EXPECT_EQ(view.not_measured, "");
    ASSERT_GE(view.measured.size(), 2u);
    EXPECT_EQ(view.measured.front().measured, targets.size());
    // A unit that finds no way stays far off.
    EXPECT_LT(view.measured.back().median_um, view.measured.front().median_um / 2);
    // The plane reports no more than the truth.
    std::uint32_t within = 0;
    for (std::uint32_t n = 0; n < targets.size(); ++n) {
      const double error_um = ErrorUm(&plane, {n}, *targets[n]);
      within += error_um <= 10 ? 1u : 0u;
      ASSERT_TRUE(plane.unit({n}).error_um);
      EXPECT_NEAR(*plane.unit({n}).error_um, error_um, 1);
      EXPECT_EQ(plane.unit({n}).knowledge[0].witness, Witness::kMeasured);
    }
    EXPECT_EQ(view.measured.back().within_tolerance, within);
    EXPECT_GE(view.counts.arrived + 1, within);
    EXPECT_GE(within, targets.size() * 9 / 10);
  }
}

TEST(MeasuredPlane, MeasuresWithoutMotion) {
  Judged judged(4);
  PlaneInProcess& plane = judged.plane;
  const auto targets = plane.DrawTargets(4);
  ApplyMeasured(&plane, targets, 0);
  ASSERT_TRUE(Finish(&plane));
  std::vector<std::uint32_t> begun;
  for (std::uint32_t n = 0; n < targets.size(); ++n)
    begun.push_back(plane.world().Truth(n).moves_begun);
  const std::uint64_t request = plane.Give(PlaneMeasureCommand{});
  ASSERT_TRUE(Finish(&plane));
  EXPECT_EQ(plane.plane().view().kind, ConfigurationKind::kMeasure);
  EXPECT_EQ(plane.plane().view().counts.targeted, targets.size());
  EXPECT_EQ(plane.plane().view().counts.arrived, targets.size());
  ASSERT_NE(plane.ReplyTo(request), nullptr);
  EXPECT_FALSE(plane.ReplyTo(request)->error);
  for (std::uint32_t n = 0; n < targets.size(); ++n)
    EXPECT_EQ(plane.world().Truth(n).moves_begun, begun[n]);
}

// A unit that has lost its place is found by the camera before anything moves.
TEST(MeasuredPlane, FindsAUnitOfUnknownPlaceFirst) {
  Judged judged(5);
  PlaneInProcess& plane = judged.plane;
  const PositionerIndex lost{plane.layout().own(1)[2]};
  const UnitId id = plane.layout().layout().unit(lost).id;
  plane.Apply(plane.DrawTargets(50));
  ASSERT_TRUE(plane.RunUntil(
      [&] { return plane.world().Truth(lost.value).state == UnitState::kMoving; }, Seconds(60)));
  plane.Run(Seconds(1));
  plane.world().disturb().PowerCut(id);
  plane.Run(Seconds(3));
  plane.world().disturb().PowerOn(id);
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(400)));
  plane.Run(Seconds(10));
  ASSERT_FALSE(IsPlace(plane.unit(lost).knowledge));
  ApplyMeasured(&plane, plane.DrawTargets(51), 1);
  ASSERT_TRUE(Finish(&plane));
  EXPECT_TRUE(IsPlace(plane.unit(lost).knowledge));
  EXPECT_NE(plane.unit(lost).outcome, TargetOutcome::kRefused) << plane.unit(lost).outcome_reason;
}

TEST(MeasuredPlane, GoesOnAfterKillsWhileTheCameraLooks) {
  for (const bool of_sector : {false, true}) {
    Judged judged(6);
    PlaneInProcess& plane = judged.plane;
    const auto targets = plane.DrawTargets(6);
    ApplyMeasured(&plane, targets, 1);
    ASSERT_TRUE(plane.RunUntil([&] { return plane.plane().view().phase == PlanePhase::kMeasuring; },
                               Seconds(400)));
    if (of_sector) plane.KillSector(1);
    if (!of_sector) plane.KillPlane();
    plane.Run(Seconds(1));
    if (of_sector) plane.StartSector(1);
    if (!of_sector) plane.StartPlane();
    ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(2000))) << of_sector;
    plane.Run(Seconds(10));
    EXPECT_GE(plane.plane().view().counts.arrived, targets.size() * 8 / 10) << of_sector;
  }
}

// Otherwise the unit would end as if it had not arrived, though it was said that it goes.
TEST(MeasuredPlane, AUnitGetsAnotherTargetWhileTheCameraLooks) {
  Judged judged(11);
  PlaneInProcess& plane = judged.plane;
  const PositionerIndex unit = plane.layout().own(1)[2];
  const Pose other = PlaceOf(plane.unit(unit).knowledge);
  ApplyMeasured(&plane, plane.DrawTargets(11), 0);
  ASSERT_TRUE(plane.RunUntil([&] { return plane.plane().view().phase == PlanePhase::kMeasuring; },
                             Seconds(400)));
  const std::uint64_t request = plane.Give(PlaneRetargetCommand{unit, other});
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(2000)));
  ASSERT_NE(plane.ReplyTo(request), nullptr);
  EXPECT_FALSE(plane.ReplyTo(request)->error);
  EXPECT_EQ(plane.unit(unit).target, other);
  EXPECT_LT(ErrorUm(&plane, unit, other), 200);
  ASSERT_TRUE(plane.unit(unit).error_um);
  EXPECT_NEAR(*plane.unit(unit).error_um, ErrorUm(&plane, unit, other), 1);
}

TEST(MeasuredPlane, APlanThatFailsAfterAnExposureIsAFailureOfTheConfiguration) {
  Judged judged(9);
  PlaneInProcess& plane = judged.plane;
  plane.planes[0].plan_fault = [&](PlanePlanDone* done) {
    if (!plane.plane().view().measured.empty())
      done->plan = Fail(ErrorCode::kRefused, "no way at all");
  };
  ApplyMeasured(&plane, plane.DrawTargets(9), 2);
  ASSERT_TRUE(Finish(&plane));
  const PlaneView& view = plane.plane().view();
  EXPECT_EQ(view.state, ConfigurationState::kFailed);
  EXPECT_GT(view.counts.failed, 0u);
  for (const PlaneInProcess::Sector& sector : plane.sectors)
    EXPECT_EQ(sector.coordinator->configuration().state, ConfigurationState::kFailed);
}

TEST(MeasuredPlane, ASectorsNextLifeIsNotSentIntoAConfigurationThatIsOver) {
  Judged judged(10);
  PlaneInProcess& plane = judged.plane;
  ApplyMeasured(&plane, plane.DrawTargets(10), 1);
  ASSERT_TRUE(Finish(&plane));
  const OutcomeCounts counts = plane.plane().view().counts;
  plane.KillSector(1);
  plane.Run(Seconds(1));
  plane.StartSector(1);
  plane.Run(Seconds(20));
  EXPECT_EQ(plane.sectors[1].coordinator->sector().stage, SectorStage::kIdle);
  EXPECT_EQ(plane.plane().view().counts, counts);
}

TEST(MeasuredPlane, AnExposureThatCannotBeUsedIsTriedAgain) {
  Judged judged(7);
  PlaneInProcess& plane = judged.plane;
  int failures = 1;
  plane.planes[0].camera.fault = [&](ExposureDone* done) {
    if (failures-- > 0) done->exposure = Fail(ErrorCode::kRefused, "too few fiducials");
  };
  ApplyMeasured(&plane, plane.DrawTargets(7), 0);
  ASSERT_TRUE(Finish(&plane));
  EXPECT_EQ(plane.plane().view().measured.size(), 1u);
  EXPECT_EQ(plane.plane().view().not_measured, "");
  failures = 100;
  ApplyMeasured(&plane, plane.DrawTargets(8), 0);
  ASSERT_TRUE(Finish(&plane));
  EXPECT_EQ(plane.plane().view().measured.size(), 0u);
  EXPECT_EQ(plane.plane().view().not_measured, "too few fiducials");
  EXPECT_EQ(plane.plane().view().counts.arrived, 0u);
  EXPECT_GT(plane.plane().view().counts.unmeasured, 0u);
}

}  // namespace
}  // namespace focalfleet
