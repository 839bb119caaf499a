#include "fleet/camera/spots.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace focalfleet {
namespace {

constexpr SensorLimits kSensor{100, 50};

Exposure Three() {
  return {"e1", 1'000'000'000'000, {{1, 10, 10, 1, 2}, {2, 20, 10, 1, 0}, {3, 99.4, 49.4, 5, 0}}};
}

std::string ErrorWith(const Spot& spot) {
  Exposure exposure = Three();
  exposure.spots.push_back(spot);
  const auto checked = CheckSpots(exposure, kSensor);
  return checked ? "" : checked.error().text;
}

TEST(CheckSpots, TakesWhatASensorCanShow) { EXPECT_TRUE(CheckSpots(Three(), kSensor)); }

TEST(CheckSpots, NamesTheSpotThatIsWrong) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(ErrorWith({9, nan, 1, 1, 0}), "spot 9: its place is not finite");
  EXPECT_EQ(ErrorWith({9, 1, infinity, 1, 0}), "spot 9: its place is not finite");
  EXPECT_EQ(ErrorWith({9, 100, 1, 1, 0}), "spot 9: it is off the sensor");
  EXPECT_EQ(ErrorWith({9, 1, -0.6, 1, 0}), "spot 9: it is off the sensor");
  EXPECT_EQ(ErrorWith({9, 1, 1, 0, 0}), "spot 9: its flux is not above 0");
  EXPECT_EQ(ErrorWith({9, 1, 1, nan, 0}), "spot 9: its flux is not above 0");
  EXPECT_EQ(ErrorWith({9, 1, 1, 1, -2}), "spot 9: its width is negative");
  EXPECT_EQ(ErrorWith({9, 1, 1, 1, nan}), "spot 9: its width is negative");
  EXPECT_EQ(ErrorWith({2, 1, 1, 1, 0}), "spot 2 is there twice");
  EXPECT_EQ(ErrorWith({9, 20, 10, 7, 0}), "spots 2 and 9 are at one place");
}

TEST(ContentOf, ForgetsOrderAndNamesAndNothingElse) {
  const Exposure exposure = Three();
  Exposure other{"another", 5, {exposure.spots[2], exposure.spots[0], exposure.spots[1]}};
  other.spots[0].id = 77;
  EXPECT_EQ(ContentOf(other), ContentOf(exposure));
  std::swap(other.spots[0].x_px, other.spots[1].x_px);
  EXPECT_NE(ContentOf(other), ContentOf(exposure));
  other = exposure;
  other.spots[1].flux += 1e-9;
  EXPECT_NE(ContentOf(other), ContentOf(exposure));
  other = exposure;
  std::swap(other.spots[0].x_px, other.spots[0].y_px);
  other.spots[0].x_px = 10.5;
  EXPECT_NE(ContentOf(other), ContentOf(exposure));
}

std::string Refused(const Exposure& exposure, const AdmissionRules& rules,
                    std::vector<SeenExposure> seen = {}) {
  const auto refusal = Admit(exposure, rules, seen);
  return refusal ? Name(refusal->reason) : "";
}

TEST(Admit, OnlyWhatWasTakenOnceAfterTheMotionAndNotLongAgo) {
  const Exposure exposure = Three();  // taken at 1000 s
  const std::int64_t s = 1'000'000'000;
  const AdmissionRules good{.motion_end_unix_ns = 990 * s, .now_unix_ns = 1010 * s};
  EXPECT_EQ(Refused(exposure, good), "");
  EXPECT_EQ(Refused(exposure, {.motion_end_unix_ns = 1000 * s, .now_unix_ns = 1000 * s}), "");
  EXPECT_EQ(Refused(exposure, {.motion_end_unix_ns = 1000 * s + 1, .now_unix_ns = 1010 * s}),
            "early");
  EXPECT_EQ(Refused(exposure, {.motion_end_unix_ns = 0, .now_unix_ns = 1061 * s}), "late");
  EXPECT_EQ(Refused(exposure, {.motion_end_unix_ns = 0, .now_unix_ns = 999 * s}), "future");
  EXPECT_EQ(Refused(exposure, good, {{"e0", 5}}), "");
  EXPECT_EQ(Refused(exposure, good, {{"e0", 5}, {"e1", 6}}), "doubled");
  EXPECT_EQ(Refused(exposure, good, {{"e0", ContentOf(exposure)}}), "doubled");
}

}  // namespace
}  // namespace focalfleet
