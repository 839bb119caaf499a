// Units that measure themselves: places from readings, sensors that fail, and requests to the
// camera.
#include "daemon/hall/fibre_carrier_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "daemon/hall/measure.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "sim/hall/fibre_carrier.h"
#include "tests/support/fibre_carrier_model.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::TestSeed;
using ::testing::HasSubstr;

constexpr std::uint32_t kUnits = 40;

class FibreCarrierWork : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    model_ = std::make_unique<HallModelFile>(test::FittedFibreCarrierModel());
  }
  static void TearDownTestSuite() { model_.reset(); }

  FibreCarrierWork()
      : layout_(Layout::Create(MakeHexLayout({.count = kUnits, .sensors = 8}), {}).value()),
        drives_(kUnits),
        joints_({.seed = seed_}),
        truth_(kUnits) {
    auto worker = FibreCarrierWorker::Create(layout_, *model_, {});
    EXPECT_TRUE(worker) << (worker ? "" : worker.error().text);
    worker_ = std::move(*worker);
    Move();
  }

  // Each unit is somewhere, and is believed to be a little beside it.
  void Move() {
    job_ = {.id = ++jobs_, .since = {}, .expected = {}, .before = {}, .seen = {}};
    job_.tolerance_um = 20;
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const Pose pose{static_cast<std::int32_t>(rng_.Uniform(-40'000, 40'000)),
                      static_cast<std::int32_t>(rng_.Uniform(2'000, 40'000))};
      truth_[n] = FibreAt(layout_.unit({n}), drives_[n], pose);
      const Pose believed{pose[0] + static_cast<std::int32_t>(rng_.Uniform(-100, 100)),
                          pose[1] + static_cast<std::int32_t>(rng_.Uniform(-100, 100))};
      job_.expected.push_back(Exactly(Witness::kReported, believed));
      job_.before.emplace_back();
      job_.seen.push_back(1);
      job_.wanted.push_back(1);
      job_.readings.push_back(Read(n));
    }
  }
  SensorReading Read(std::uint32_t n) {
    const Unit& unit = layout_.unit({n});
    SensorReading reading{.sensors = 8};
    joints_.Read(
        unit.id, readings_++,
        {truth_[n].x_mm - unit.base_fp.x_mm, truth_[n].y_mm - unit.base_fp.y_mm, unit.carrier_mm},
        {reading.counts.data(), 8});
    return reading;
  }
  std::vector<Measurement> Measure() { return worker_->Measure(job_, drives_); }
  double ErrorUm(const Measurement& measurement) const {
    const PointFp& at = truth_[measurement.unit.value];
    return 1e3 * std::hypot(measurement.x_mm - at.x_mm, measurement.y_mm - at.y_mm);
  }

  std::uint64_t seed_ = TestSeed(11);
  ::testing::ScopedTrace trace_{__FILE__, __LINE__, "FOCALFLEET_SEED=" + std::to_string(seed_)};
  Rng rng_{seed_};
  Layout layout_;
  std::vector<UnitDrive> drives_;
  sim::FibreCarrierJoints joints_;
  std::vector<PointFp> truth_;
  std::unique_ptr<FibreCarrierWorker> worker_;
  ExposureJob job_;
  std::uint64_t jobs_ = 0;
  std::uint32_t readings_ = 0;
  static std::unique_ptr<HallModelFile> model_;
};
std::unique_ptr<HallModelFile> FibreCarrierWork::model_;

TEST_F(FibreCarrierWork, PutsUnitsWhereTheyAre) {
  double worst_um = 0;
  for (int round = 0; round < 5; ++round) {
    Move();
    const auto measurements = Measure();
    ASSERT_EQ(measurements.size(), kUnits);
    for (const Measurement& measurement : measurements) {
      EXPECT_EQ(measurement.status, MeasurementStatus::kMeasured) << measurement.carrier->verdict;
      EXPECT_EQ(measurement.carrier->verdict, "ok");
      EXPECT_EQ(measurement.source, MeasurementSource::kSensors);
      EXPECT_LT(ErrorUm(measurement), 6 * SigmaUm(measurement.covariance));
      worst_um = std::max(worst_um, ErrorUm(measurement));
      ASSERT_TRUE(measurement.place);
      const PointFp there = FibreAt(layout_.unit(measurement.unit), drives_[0], *measurement.place);
      EXPECT_NEAR(there.x_mm, measurement.x_mm, 0.005);
      EXPECT_NEAR(there.y_mm, measurement.y_mm, 0.005);
    }
  }
  EXPECT_LT(worst_um, 20);
}

// For any reading of one sensor, one of three things holds. The sensor is named; or the result is
// "cannot tell" and there is no place; or the reading did no harm. The test covers all units,
// sensors and kinds of fault, at the first reading and with a history.
TEST_F(FibreCarrierWork, ASensorThatLiesIsNamedOrNoPlaceIsReported) {
  enum Lie { kStuck, kSaturated, kMissing, kSwapped, kGain, kLies };
  int named[kLies] = {}, wrongly[kLies] = {}, untold[kLies] = {}, harmless[kLies] = {};
  for (int round = 0; round < 13; ++round) {
    Move();
    for (std::uint32_t n = 0; n < kLies; ++n) {
      auto& counts = job_.readings[n].counts;
      if (n == kStuck) counts[3] = 20'000;
      if (n == kSaturated) counts[3] = kFullCount;
      if (n == kMissing) counts[3] = kNoCount;
      if (n == kSwapped) std::swap(counts[3], counts[6]);
      if (n == kGain) counts[3] = static_cast<std::uint16_t>(32767 + (counts[3] - 32767) * 7 / 10);
    }
    const auto measurements = Measure();
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const Measurement& measurement = measurements[n];
      const std::string& verdict = measurement.carrier->verdict;
      if (n >= kLies) {
        EXPECT_EQ(verdict, "ok") << n;
        continue;
      }
      const bool put = IsCertain(measurement.status);
      if (put) {
        EXPECT_LT(ErrorUm(measurement), 50) << "a lie is believed: " << n << ", " << verdict;
      }
      EXPECT_EQ(put, measurement.carrier->trusted) << verdict;
      const bool names_it = verdict.find("v4") != std::string::npos;
      const bool names_another =
          !names_it && verdict != "ok" && verdict.find(" v") != std::string::npos;
      ++(names_it ? named : names_another ? wrongly : put ? harmless : untold)[n];
    }
  }
  for (int lie = 0; lie < kLies; ++lie)
    std::printf("lie %d: named %d, another named %d, cannot tell %d, harmless %d of 13\n", lie,
                named[lie], wrongly[lie], untold[lie], harmless[lie]);
  EXPECT_EQ(named[kSaturated], 13);
  EXPECT_EQ(named[kMissing], 13);
  for (const int lie : {kStuck, kSwapped, kGain}) {
    EXPECT_GE(named[lie] + harmless[lie], 9) << lie;
    EXPECT_LE(wrongly[lie], 1) << lie;
  }
}

TEST_F(FibreCarrierWork, WhatIsLessExactThanAskedForIsNotUsed) {
  job_.tolerance_um = 0.5;
  for (const Measurement& measurement : Measure()) {
    EXPECT_EQ(measurement.status, MeasurementStatus::kTooCoarse);
    EXPECT_FALSE(measurement.place);
  }
}

TEST_F(FibreCarrierWork, TooFewSensorsGiveNoPlace) {
  for (std::size_t k = 0; k < 4; ++k) job_.readings[0].counts[2 * k] = kNoCount;
  const Measurement measurement = Measure().front();
  EXPECT_EQ(measurement.status, MeasurementStatus::kSensorsDoubted);
  EXPECT_EQ(measurement.carrier->verdict, "missing v1 v3 v5 v7; too few sensors");
}

TEST_F(FibreCarrierWork, AUnitThatStayedIsSaidNotToHaveMoved) {
  Pose before = PlaceOf(job_.expected[0]);
  before[1] += before[1] > 20'000 ? -8'000 : 8'000;
  truth_[0] = FibreAt(layout_.unit({0}), drives_[0], before);
  job_.before[0] = before;
  job_.readings[0] = Read(0);
  EXPECT_EQ(Measure().front().status, MeasurementStatus::kDidNotMove);
}

/// The camera counts the requests and sees nothing.
class CountingPort : public CameraPort {
 public:
  explicit CountingPort(int* asked) : asked_(asked) {}
  Status Request(std::uint64_t, WallTime) override {
    ++*asked_;
    return {};
  }
  Result<std::optional<Exposure>> Take() override { return std::optional<Exposure>(); }

 private:
  int* asked_;
};

TEST_F(FibreCarrierWork, TheCameraIsAskedOnlyForThoseWhoNeedIt) {
  int asked = 0;
  CameraWorker::Options options;
  options.layout = &layout_;
  options.patience = std::chrono::milliseconds(1);
  options.pause = std::chrono::milliseconds(1);
  CameraWorker camera(std::make_unique<CountingPort>(&asked), options);
  const std::atomic<bool> ending{false};
  const ExposureDone all = MeasureUnits({job_, drives_}, worker_.get(), &camera, ending);
  ASSERT_TRUE(all.exposure);
  EXPECT_EQ(asked, 0);
  EXPECT_FALSE(all.exposure->camera);
  EXPECT_EQ(all.exposure->measurements.size(), kUnits);

  job_.readings[5].counts[2] = 1'000;
  job_.wanted[5] = 0;
  ASSERT_TRUE(MeasureUnits({job_, drives_}, worker_.get(), &camera, ending).exposure);
  EXPECT_EQ(asked, 0) << "nobody asks where unit 6 is";
  job_.wanted[5] = 1;
  const ExposureDone without = MeasureUnits({job_, drives_}, worker_.get(), &camera, ending);
  EXPECT_EQ(asked, 1);
  ASSERT_TRUE(without.exposure) << "a dead camera takes away only its own units";
  EXPECT_THAT(without.exposure->camera_trouble, HasSubstr("nothing came from the camera"));
  EXPECT_EQ(without.exposure->measurements[5].status, MeasurementStatus::kSensorsDoubted);
  EXPECT_EQ(without.exposure->measurements[6].status, MeasurementStatus::kMeasured);
  EXPECT_FALSE(MeasureUnits({job_, drives_}, nullptr, &camera, ending).exposure);
}

TEST_F(FibreCarrierWork, SetsOfSensorsThatNobodyKnowsAreRefused) {
  std::vector<Unit> units = MakeHexLayout({.count = 2, .sensors = 8});
  units[1].sensors = 7;
  const Layout layout = Layout::Create(std::move(units), {}).value();
  const auto worker = FibreCarrierWorker::Create(layout, *model_, {});
  ASSERT_FALSE(worker);
  EXPECT_EQ(worker.error().text, "unit 2 has 7 sensors; sets of 6 and of 8 are known");
}

}  // namespace
}  // namespace focalfleet
