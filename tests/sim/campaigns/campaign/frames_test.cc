// A camera that was moved between frames is no effect of the fibres.
#include "sim/campaigns/campaign/frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "sim/campaigns/diagnosis/model/one_frame.h"
#include "tests/sim/campaigns/planting/moved_camera.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::FrameAt;
using test::MoveCamera;
using test::Planted;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMove_um = 5;  // what places are off by, of a fleet without effects

double FarthestOff_um(const Campaign& a, const Campaign& b) {
  double most = 0;
  for (std::size_t row = 0; row < a.rows(); ++row)
    if (std::isfinite(a.x_mm[row]))
      most = std::max(most, 1e3 * std::hypot(a.x_mm[row] - b.x_mm[row], a.y_mm[row] - b.y_mm[row]));
  return most;
}

TEST(Frames, TheOneWithMostRowsIsTheFirst) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 40});
  EXPECT_THAT(FindFrames(campaign).of_row, IsEmpty()) << "no column";
  MoveCamera({{.id = 9, .until = 10}, {.id = -3, .until = 30}, {.id = kNone, .until = 40}},
             &campaign);
  const Frames frames = FindFrames(campaign);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames.id[0], -3);
  EXPECT_EQ(frames.id[1], 9);
  EXPECT_TRUE(std::isnan(frames.id[2]));
  EXPECT_EQ(frames.of_row[0], 1u);
  EXPECT_EQ(frames.of_row[39], 2u);
}

TEST(Frames, ASingleOneNeedsNothing) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 40});
  MoveCamera({{.id = 4, .until = 40, .shift_x_um = 500}}, &campaign);
  EXPECT_THAT(FindFrames(campaign).of_row, IsEmpty());
  const Campaign before = campaign;
  BringIntoOneFrame(OneAfterTheOther(), &campaign);
  EXPECT_EQ(FarthestOff_um(before, campaign), 0);
}

TEST(Frames, AreTakenToTheFirst) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Campaign still = Planted({}, {.units = 24, .moves = 40, .seed = seed});
    Campaign moved = still;
    MoveCamera({{.id = 1, .until = 25},
                {.id = 2,
                 .until = 40,
                 .shift_x_um = 4000,
                 .shift_y_um = -900,
                 .turn_urad = 2e4,
                 .scale_ppm = 3000}},
               &moved);
    EXPECT_GT(FarthestOff_um(still, moved), 3000) << seed;
    BringIntoOneFrame(OneAfterTheOther(), &moved);
    EXPECT_LT(FarthestOff_um(still, moved), kMove_um) << seed;
  }
}

// Zeros that no table knows put places of the table millimetres off.
TEST(Frames, AreTakenToTheFirstThoughZerosAreUnknown) {
  const Campaign still = Planted({}, {.units = 24, .moves = 60, .seed = 5});
  Campaign moved = still;
  Rng rng = Rng::Stream(5, "zeros");
  for (CampaignUnit& unit : moved.units) unit.zero_deg[kTheta] += rng.Uniform(-180, 180);
  MoveCamera({{.id = 1, .until = 30}, {.id = 2, .until = 60, .shift_x_um = 4000}}, &moved);
  BringIntoOneFrame(OneAfterTheOther(), &moved);
  EXPECT_LT(FarthestOff_um(still, moved), kMove_um);
}

TEST(Frames, AFrameOfOneRowIsShifted) {
  const Campaign still = Planted({}, {.units = 1, .moves = 40, .seed = 2});
  Campaign moved = still;
  MoveCamera({{.id = 1, .until = 39}, {.id = 2, .until = 40, .shift_x_um = 4000}}, &moved);
  BringIntoOneFrame(OneAfterTheOther(), &moved);
  EXPECT_LT(FarthestOff_um(still, moved), 100);
}

}  // namespace
}  // namespace focalfleet::sim
