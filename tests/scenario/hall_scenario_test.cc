// These tests run configurations of units that measure themselves by the sensors at their joints,
// with the truth at hand. The coordinator uses their readings, no exposure is needed, and a faulty
// sensor moves no unit.
#include <gtest/gtest.h>

#include <cmath>

#include "daemon/hall/measure.h"
#include "fleet/kinematics.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/fibre_carrier_model.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::FittedFibreCarrierModel;
using test::HasAlarm;
using test::InProcessFleet;

class HallScenario : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    model_ = std::make_unique<HallModelFile>(FittedFibreCarrierModel());
  }
  static void TearDownTestSuite() { model_.reset(); }

  void Make(const InProcessFleet::Options& options) {
    fleet_ = std::make_unique<InProcessFleet>(options);
    auto worker = FibreCarrierWorker::Create(fleet_->layout(), *model_, {});
    ASSERT_TRUE(worker) << worker.error().text;
    worker_ = std::move(*worker);
    fleet_->camera.measurer = [this](const ExposureJob& job) {
      const std::vector<UnitDrive> drives(job.expected.size());
      return MeasureUnits({job, drives}, worker_.get(), nullptr, std::atomic<bool>(false));
    };
  }
  double TrueErrorUm(std::uint32_t n) {
    const UnitView& view = fleet_->coordinator().unit({n});
    const PointFp wanted = FibreAt(fleet_->layout().units()[n], UnitDrive{}, *view.target);
    const sim::UnitTruth truth = fleet_->world().Truth(n);
    return 1e3 * std::hypot(truth.x_mm - wanted.x_mm, truth.y_mm - wanted.y_mm);
  }

  std::unique_ptr<InProcessFleet> fleet_;
  std::unique_ptr<FibreCarrierWorker> worker_;
  static std::unique_ptr<HallModelFile> model_;
};
std::unique_ptr<HallModelFile> HallScenario::model_;

// As Measured.CorrectionsBringUnitsWithRealGearsToTheirTargets, without a camera.
TEST_F(HallScenario, CorrectionsBringUnitsToTheirTargetsWithoutACamera) {
  Make({.count = 150,
        .seed = 3,
        .config = {.reads_sensors = true},
        .spread = sim::Spread::kReal,
        .sensors = 8});
  fleet_->ApplyRandomMeasured(1, {.corrections = 2, .tolerance_um = 20});
  ASSERT_TRUE(fleet_->RunUntilIdle());
  const ConfigurationView& view = fleet_->coordinator().configuration();
  ASSERT_EQ(view.measured.size(), 3u);
  for (const MeasuredRound& round : view.measured) {
    EXPECT_FALSE(round.camera);
    EXPECT_EQ(round.by_sensors, round.measured);
  }
  EXPECT_GE(view.measured[2].within_tolerance, 138u);
  for (std::uint32_t n = 0; n < fleet_->layout().size(); ++n) {
    const UnitView& unit = fleet_->coordinator().unit({n});
    if (unit.outcome != TargetOutcome::kArrived || !unit.error_um) {
      EXPECT_FALSE(unit.outcome_reason.empty()) << n;
      continue;
    }
    EXPECT_EQ(unit.knowledge[0].witness, Witness::kMeasured);
    EXPECT_LT(TrueErrorUm(n), 20 + 6 * SigmaUm(unit.covariance)) << n;
  }
  std::printf("within 20 um: %u of %u; median %.1f um\n", view.measured[2].within_tolerance,
              view.measured[2].measured, view.measured[2].median_um);
}

TEST_F(HallScenario, WhoseSensorLiesIsNamedAndStaysAsItReports) {
  Make({.count = 40, .seed = 5, .config = {.reads_sensors = true}, .sensors = 8});
  using Kind = sim::UnitFaults::Sensor::Kind;
  fleet_->world().disturb().faults(fleet_->id(3))->sensor = {Kind::kStuck, 2, 0};
  fleet_->world().disturb().faults(fleet_->id(4))->sensor = {Kind::kSwapped, 0, 5};
  fleet_->world().disturb().faults(fleet_->id(5))->sensor = {Kind::kMissing, 6, 0};
  fleet_->ApplyRandomMeasured(1, {.corrections = 1, .tolerance_um = 20});
  ASSERT_TRUE(fleet_->RunUntilIdle());
  for (const std::uint32_t liar : {3u, 4u}) {
    const UnitView& view = fleet_->coordinator().unit({liar});
    EXPECT_EQ(view.measurement, MeasurementStatus::kSensorsDoubted);
    EXPECT_EQ(view.knowledge[0].witness, Witness::kReported);
    EXPECT_FALSE(view.error_um);
    EXPECT_NE(view.outcome_reason.find(view.carrier->verdict), std::string::npos);
    EXPECT_TRUE(HasAlarm(*fleet_, "unit " + std::to_string(fleet_->id(liar).value) +
                                      " is not measured by its sensors: "));
    std::printf("unit %u: %s\n", liar, view.outcome_reason.c_str());
  }
  const UnitView& without = fleet_->coordinator().unit({5});
  EXPECT_EQ(without.knowledge[0].witness, Witness::kMeasured);
  EXPECT_EQ(without.carrier->verdict, "missing v7");
  const MeasuredRound& last = fleet_->coordinator().configuration().measured.back();
  EXPECT_EQ(last.measured, 38u);
  EXPECT_EQ(last.unknown, 2u);
}

TEST_F(HallScenario, WhoDoesNotTellItsSensorsIsNotLost) {
  Make({.count = 20, .seed = 6, .config = {.reads_sensors = true}, .sensors = 8});
  fleet_->world().disturb().faults(fleet_->id(2))->ignores = Function::kSensors;
  fleet_->world().disturb().faults(fleet_->id(7))->protocol_version = kProtocolVersion;
  fleet_->ApplyRandomMeasured(1, {.corrections = 0, .tolerance_um = 20});
  ASSERT_TRUE(fleet_->RunUntilIdle());
  for (const std::uint32_t mute : {2u, 7u}) {
    const UnitView& view = fleet_->coordinator().unit({mute});
    EXPECT_EQ(view.phase, UnitPhase::kReady);
    EXPECT_EQ(view.knowledge[0].witness, Witness::kReported);
  }
  EXPECT_TRUE(HasAlarm(*fleet_, "has sensors, but it does not report their readings"));
  EXPECT_TRUE(HasAlarm(*fleet_, "has sensors, but its firmware knows of none"));
  EXPECT_EQ(fleet_->coordinator().configuration().measured.back().measured, 18u);
}

// A unit that missed its host for a while reports that, and is read anew before any other request.
// Its sensors are read, too, as soon as the unit is known again.
TEST_F(HallScenario, WhoIsReadAnewInBetweenIsMeasuredNevertheless) {
  Make({.count = 40, .seed = 8, .config = {.reads_sensors = true}, .sensors = 8});
  fleet_->ApplyRandomMeasured(1, {.corrections = 0, .tolerance_um = 20});
  ASSERT_TRUE(fleet_->RunUntil([&] { return CountOutcome(*fleet_, TargetOutcome::kArrived) == 40; },
                               Seconds(300)));
  fleet_->Freeze(Seconds(120), InProcessFleet::Heard::kWaits);
  ASSERT_TRUE(fleet_->RunUntilIdle()) << "also where nobody is measured";
  const MeasuredRound& last = fleet_->coordinator().configuration().measured.back();
  EXPECT_EQ(last.measured, 40u);
}

TEST_F(HallScenario, ASensorsReadingTakesHalfAMillisecondOfItsBus) {
  Make({.count = 40,
        .units_per_bus = 40,
        .seed = 7,
        .config = {.reads_sensors = true},
        .sensors = 8});
  std::vector<sim::WireFrame> wire;
  fleet_->wire = &wire;
  fleet_->ApplyRandomMeasured(1, {.corrections = 0, .tolerance_um = 20});
  ASSERT_TRUE(fleet_->RunUntilIdle());
  std::uint32_t frames = 0;
  HostInstant first = kNever, last{0};
  for (const sim::WireFrame& frame : wire) {
    if (static_cast<Function>(frame.frame.id >> 20 & 63) != Function::kSensors) continue;
    ++frames;
    first = std::min(first, frame.at);
    last = std::max(last, frame.at);
  }
  EXPECT_EQ(frames, 40u * 4);
  EXPECT_LT((last - first).seconds(), 40 * 0.55e-3);
  std::printf("40 units of a bus: %.1f ms\n", 1e3 * (last - first).seconds());
}

}  // namespace
}  // namespace focalfleet
