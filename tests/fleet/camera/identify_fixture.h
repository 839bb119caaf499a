// A simulated plate before its camera, for tests of identification.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "fleet/camera/identify.h"
#include "tests/support/camera_field.h"
#include "tests/support/seed.h"

namespace focalfleet::test {

inline constexpr FieldTroubles kNoTroubles{
    .tail_share = 0, .dead_share = 0, .slipping_share = 0, .disabled_share = 0, .swaps = 0};

class IdentifyTest : public ::testing::Test {
 protected:
  IdentifyTest() {
    traits_ = TestCamera(Rim());
    traits_.missing_share = 0;
    traits_.extra_share = 0;
  }

  [[nodiscard]] double Rim() const {
    double rim_mm = 0;
    for (const Unit& unit : field_.layout().units())
      rim_mm = std::max(rim_mm, std::hypot(unit.base_fp.x_mm, unit.base_fp.y_mm));
    return rim_mm;
  }

  void Picture(std::vector<sim::LightSource> sources) {
    image_ = sim::TakeImage(sources, traits_, &field_.rng());
    exposure_ = ExposureOf(image_, "1");
  }

  tl::expected<Identification, Refusal> Ask(const std::vector<UnitExpectation>& expectations) {
    return focalfleet::Identify({.layout = &field_.layout(),
                                 .expectations = expectations,
                                 .fiducials = field_.fiducials(),
                                 .camera = &model_,
                                 .exposure = &exposure_},
                                options_);
  }

  Identification See() {
    Picture(field_.Sources());
    auto result = Ask(field_.Expectations());
    EXPECT_TRUE(result) << (result ? "" : result.error().text);
    return result ? std::move(*result) : Identification{};
  }

  std::string RefusedAs() {
    const auto result = Ask(field_.Expectations());
    return result ? "" : Name(result.error().reason);
  }

  static std::uint32_t Count(const Identification& seen, MeasurementStatus status) {
    return seen.count[static_cast<std::size_t>(status)];
  }

  /// The k-th of the healthy units whose fibre moved far.
  std::uint32_t FarMover(int k) {
    for (std::uint32_t i = 0; i < field_.units().size(); ++i) {
      const auto& unit = field_.units()[i];
      const bool far = std::abs(unit.before.theta_deg - unit.commanded.theta_deg) > 30 &&
                       std::abs(unit.before.phi_deg - unit.commanded.phi_deg) > 20;
      if (far && k-- == 0) return i;
    }
    ADD_FAILURE();
    return 0;
  }

  CameraField field_{{.count = 217, .fiducials = 24}, TestSeed(1)};
  sim::CameraTraits traits_;
  CameraModel model_ = ModelOf(TestCamera(Rim()));
  IdentifyOptions options_;
  sim::Image image_;
  Exposure exposure_;
};

}  // namespace focalfleet::test
