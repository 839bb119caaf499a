// Exposures that do not answer the request are not used, and the reason is reported.
#include "daemon/camera/camera_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "fleet/kinematics.h"
#include "tests/support/camera_field.h"

namespace focalfleet {
namespace {

using test::CameraField;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::int64_t kNowNs = 1'795'316'645'000'000'000;
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr double kRimMm = 260;  // beyond the outermost fibre

/// The port hands over the exposures that it was filled with, one after the other.
class ScriptedPort : public CameraPort {
 public:
  explicit ScriptedPort(std::deque<Exposure>* exposures) : exposures_(exposures) {}
  Status Request(std::uint64_t, WallTime) override { return {}; }
  Result<std::optional<Exposure>> Take() override {
    if (exposures_->empty()) return std::optional<Exposure>();
    Exposure next = std::move(exposures_->front());
    exposures_->pop_front();
    return std::optional(std::move(next));
  }

 private:
  std::deque<Exposure>* exposures_;
};

class CameraWorkTest : public ::testing::Test {
 protected:
  CameraWorkTest() : field_({.count = 300, .units_per_bus = 100, .fiducials = 40}, 7) {
    const test::FieldTroubles none{
        .tail_share = 0, .dead_share = 0, .slipping_share = 0, .disabled_share = 0, .swaps = 0};
    field_.Move(none);
    const sim::CameraTraits traits = test::TestCamera(kRimMm);
    options_ = {.layout = &field_.layout(),
                .site = {.model = test::ModelOf(traits),
                         .sensor = {traits.sensor_px.real(), traits.sensor_px.imag()},
                         .fiducials = field_.fiducials(),
                         .options = {}},
                .patience = std::chrono::milliseconds(30),
                .pause = std::chrono::milliseconds(1),
                .now = [this] { return WallTime{now_ns_}; },
                .log = [this](const std::string& text) { log_.push_back(text); }};
    worker_ = std::make_unique<CameraWorker>(std::make_unique<ScriptedPort>(&exposures_), options_);
    work_.drives.assign(field_.layout().size(), UnitDrive{});
    for (std::uint32_t n = 0; n < field_.layout().size(); ++n) {
      const Unit& unit = field_.layout().units()[n];
      work_.job.expected.push_back(At(unit, field_.units()[n].commanded));
      work_.job.before.push_back(PlaceOf(At(unit, field_.units()[n].before)));
    }
    work_.job.seen.assign(field_.layout().size(), 1);
    work_.job.id = 5;
  }
  static UnitKnowledge At(const Unit& unit, const AxisAngles& angles) {
    UnitKnowledge knowledge;
    const std::array<double, kAxisCount> deg{angles.theta_deg, angles.phi_deg};
    for (const Axis axis : kAxes) {
      const std::int32_t place =
          NearestVectors(deg[Index(axis)], unit.axis[Index(axis)], AxisDrive{});
      knowledge[Index(axis)] = {Witness::kReported, place, place};
    }
    return knowledge;
  }
  Exposure Take(const std::string& id) {
    sim::CameraTraits traits = test::TestCamera(kRimMm);
    Exposure exposure =
        test::ExposureOf(sim::TakeImage(field_.Sources(), traits, &field_.rng()), id);
    exposure.taken_unix_ns = now_ns_ + kSecondNs / 100;
    return exposure;
  }
  ExposureDone Do() {
    const std::atomic<bool> ending{false};
    return worker_->Do(work_, ending);
  }
  void ExpectRefused(Exposure exposure, const char* reason) {
    exposures_.push_back(std::move(exposure));
    const ExposureDone done = Do();
    ASSERT_FALSE(done.exposure) << reason;
    EXPECT_THAT(done.exposure.error().text, HasSubstr(reason));
    ASSERT_FALSE(log_.empty());
    EXPECT_THAT(log_.back(), HasSubstr(reason));
  }

  CameraField field_;
  std::int64_t now_ns_ = kNowNs;
  std::deque<Exposure> exposures_;
  std::vector<std::string> log_;
  CameraWork work_;
  CameraWorker::Options options_;
  std::unique_ptr<CameraWorker> worker_;
};

TEST_F(CameraWorkTest, PutsEachUnitWhereItIs) {
  exposures_.push_back(Take("good"));
  const ExposureDone done = Do();
  ASSERT_TRUE(done.exposure) << done.exposure.error().text;
  EXPECT_EQ(done.id, 5u);
  ASSERT_EQ(done.exposure->measurements.size(), 300u);
  std::uint32_t placed = 0;
  for (const Measurement& measurement : done.exposure->measurements) {
    if (!measurement.place) continue;
    ++placed;
    const Unit& unit = field_.layout().unit(measurement.unit);
    const std::complex<double> truth = field_.units()[measurement.unit.value].place_mm;
    EXPECT_LT(std::hypot(measurement.x_mm - truth.real(), measurement.y_mm - truth.imag()), 0.015);
    // The place in vectors is where the camera saw the fibre, to half a vector of each axis.
    const PointFp at = FibreAt(unit, UnitDrive{}, *measurement.place);
    EXPECT_LT(std::hypot(at.x_mm - measurement.x_mm, at.y_mm - measurement.y_mm), 0.004);
  }
  EXPECT_GE(placed, 295u);
}

TEST_F(CameraWorkTest, WhatMayNotAnswerIsRefusedWithItsReason) {
  Exposure early = Take("early");
  early.taken_unix_ns = now_ns_ - 2 * kSecondNs;
  ExpectRefused(early, "early");
  Exposure future = Take("future");
  future.taken_unix_ns = now_ns_ + 10 * kSecondNs;
  ExpectRefused(future, "future");
  Exposure turned = Take("turned");
  const std::complex<double> far_corner = test::TestCamera(kRimMm).sensor_px - 1.0;
  for (Spot& spot : turned.spots) {
    spot.x_px = far_corner.real() - spot.x_px;
    spot.y_px = far_corner.imag() - spot.y_px;
  }
  ExpectRefused(turned, "turned");
  Exposure few = Take("few");
  few.spots.resize(40);
  ExpectRefused(few, "count");
  Exposure broken = Take("broken");
  broken.spots[7].x_px = std::nan("");
  ExpectRefused(broken, "spot");
}

TEST_F(CameraWorkTest, AnotherFieldIsRefused) {
  const Exposure other = [&] {
    CameraField elsewhere({.count = 300, .units_per_bus = 100, .fiducials = 40}, 8);
    elsewhere.Move({});
    return test::ExposureOf(
        sim::TakeImage(elsewhere.Sources(), test::TestCamera(kRimMm), &elsewhere.rng()), "other");
  }();
  Exposure exposure = other;
  exposure.taken_unix_ns = now_ns_ + kSecondNs / 100;
  ExpectRefused(exposure, "other_field");
}

TEST_F(CameraWorkTest, TheSameExposureTwiceAnswersOnce) {
  const Exposure first = Take("first");
  exposures_.push_back(first);
  ASSERT_TRUE(Do().exposure);
  ExpectRefused(first, "doubled");
  Exposure renamed = first;
  renamed.id = "another name";
  ExpectRefused(renamed, "doubled");
}

TEST_F(CameraWorkTest, AGoodExposureAfterABadOneIsTaken) {
  Exposure early = Take("early");
  early.taken_unix_ns = now_ns_ - 2 * kSecondNs;
  exposures_.push_back(early);
  exposures_.push_back(Take("good"));
  EXPECT_TRUE(Do().exposure);
  ASSERT_EQ(log_.size(), 1u);
  EXPECT_THAT(log_[0], HasSubstr("early"));
}

/// The port hands over the same old exposure again and again, and counts the calls.
class ChatteringPort : public CameraPort {
 public:
  explicit ChatteringPort(Exposure exposure) : exposure_(std::move(exposure)) {}
  Status Request(std::uint64_t, WallTime) override { return {}; }
  Result<std::optional<Exposure>> Take() override {
    constexpr int kPatience = 100'000;  // calls; many times what the worker makes until it gives up
    if (++given_ > kPatience) return Fail(ErrorCode::kInvalid, "it was not given up");
    exposure_.id = "chatter " + std::to_string(given_);
    return std::optional(exposure_);
  }

 private:
  Exposure exposure_;
  int given_ = 0;
};

TEST_F(CameraWorkTest, ACameraThatSendsWhatCannotBeUsedIsWaitedForNoLonger) {
  Exposure early = Take("early");
  early.taken_unix_ns = now_ns_ - 2 * kSecondNs;
  CameraWorker worker(std::make_unique<ChatteringPort>(early), options_);
  const std::atomic<bool> ending{false};
  const ExposureDone done = worker.Do(work_, ending);
  ASSERT_FALSE(done.exposure);
  EXPECT_THAT(done.exposure.error().text, Not(HasSubstr("not given up")));
}

TEST_F(CameraWorkTest, ADeadCameraIsWaitedForSoLongAndNoLonger) {
  const ExposureDone done = Do();
  ASSERT_FALSE(done.exposure);
  EXPECT_EQ(done.exposure.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(done.exposure.error().text, HasSubstr("nothing came from the camera within 30 ms"));
  const std::atomic<bool> ending{true};
  EXPECT_THAT(worker_->Do(work_, ending).exposure.error().text, HasSubstr("ends"));
}

}  // namespace
}  // namespace focalfleet
