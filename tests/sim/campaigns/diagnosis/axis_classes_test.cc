// Robots are simulated axis by axis, and their classes read from the places alone.
#include "sim/campaigns/diagnosis/use/axis_classes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"
#include "tests/sim/campaigns/planting/robots.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using focalfleet::test::TestSeed;
using ::testing::ElementsAre;
using ::testing::Pair;

using test::CampaignOf;
using test::Healthy;
using test::kMoves;
using test::kNoise_mm;
using test::PlantedAxis;
using test::Robot;
using test::Scaled;
using test::StuckAt;

// Phi has no stalls and one scale here: an open loop would drive it out of its range.
std::vector<Robot> Robots() {
  const PlantedAxis slips{.is = AxisClass::kSlipping,
                          .scale_cw = 0.8,
                          .scale_ccw = 0.8,
                          .stall_share = 0.45,
                          .begins_deg = 10};
  const PlantedAxis parked{.is = AxisClass::kUnknown, .is_parked = true};
  return {{{Healthy(), Healthy()}},
          {{Scaled(0.6, 0.6), Healthy()}},
          {{Healthy(), Scaled(0.6, 0.6)}},
          {{Scaled(0.7, 0.9), Healthy()}},
          {{slips, Healthy()}},
          {{Healthy(), parked}},
          {{StuckAt(25), Healthy()}},
          {{Healthy(), StuckAt(75)}}};
}

void ExpectAsPlanted(const PlantedAxis& planted, std::size_t stalls, const AxisReport& report) {
  EXPECT_EQ(Name(report.is), Name(planted.is));
  const bool turns = planted.is != AxisClass::kStuck && planted.is != AxisClass::kUnknown;
  ASSERT_EQ(report.scale_cw.has_value(), turns);
  ASSERT_EQ(report.scale_ccw.has_value(), turns);
  if (turns) {
    EXPECT_NEAR(*report.scale_cw, planted.scale_cw, 0.02);
    EXPECT_NEAR(*report.scale_ccw, planted.scale_ccw, 0.02);
    EXPECT_EQ(report.stalls, stalls);
  }
  ASSERT_EQ(report.stuck_at_deg.has_value(), planted.is == AxisClass::kStuck);
  if (report.stuck_at_deg) {
    EXPECT_NEAR(std::remainder(*report.stuck_at_deg - planted.begins_deg, 360), 0, 1);
  }
}

TEST(AxisClasses, AreThosePlantedInOpenAndInClosedLoops) {
  const std::uint64_t seed = TestSeed(81);
  FOCALFLEET_TRACE_SEED(seed);
  for (const bool closed : {false, true}) {
    std::vector<Robot> robots = Robots();
    const Campaign campaign = CampaignOf(seed, closed, &robots);
    const std::vector<AxisReport> axes = ClassifyAxes(campaign, campaign.units);
    ASSERT_EQ(axes.size(), 2 * robots.size());
    for (std::size_t k = 0; k < axes.size(); ++k) {
      SCOPED_TRACE((closed ? "closed, robot " : "open, robot ") + std::to_string(k / 2) +
                   (k % 2 == kTheta ? ", theta" : ", phi"));
      const PlantedAxis& planted = robots[k / 2].axis[k % 2];
      EXPECT_EQ(axes[k].unit_id, campaign.units[k / 2].id);
      EXPECT_EQ(axes[k].axis, k % 2);
      ExpectAsPlanted(planted, robots[k / 2].stalls[k % 2], axes[k]);
      EXPECT_EQ(axes[k].wraps, 0u);
      // In an open loop nobody saw where the first move began.
      const std::size_t seen = closed ? kMoves : kMoves - 1;
      EXPECT_EQ(axes[k].moves, planted.is_parked ? 0 : seen);
    }
    const double rms_um = axes[kTheta].rms_um;
    EXPECT_NEAR(rms_um, 1e3 * std::numbers::sqrt2 * kNoise_mm, closed ? 6 : 1.5) << closed;
    EXPECT_EQ(axes[kPhi].rms_um, rms_um) << "both axes have the unit's";
  }
}

TEST(AxisClasses, EachDirectionHasItsOwnScaleInAClosedLoop) {
  const std::uint64_t seed = TestSeed(82);
  FOCALFLEET_TRACE_SEED(seed);
  std::vector<Robot> robots = {{{Scaled(0.4, 0.7), Scaled(0.8, 0.5)}}};
  const Campaign campaign = CampaignOf(seed, true, &robots);
  for (const AxisReport& axis : ClassifyAxes(campaign, campaign.units))
    ExpectAsPlanted(robots[0].axis[axis.axis], 0, axis);
}

// A coordinator that counts a dead axis' turns on, as if it had made the whole ones that were
// asked.
TEST(AxisClasses, WholeTurnsOfADeadAxisAreNoTurns) {
  const std::uint64_t seed = TestSeed(84);
  FOCALFLEET_TRACE_SEED(seed);
  std::vector<Robot> robots = {{{StuckAt(25), Healthy()}}};
  Campaign campaign = CampaignOf(seed, true, &robots);
  double counted_deg = 0;
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    campaign.from_deg[kTheta][row] += counted_deg;
    campaign.cmd_deg[kTheta][row] += counted_deg;
    if (row % 2 == 0) continue;
    const double whole = row % 4 == 1 ? -360 : 360;
    campaign.cmd_deg[kTheta][row] = campaign.from_deg[kTheta][row] + 1.12 * whole;
    counted_deg += whole;
  }
  ExpectAsPlanted(robots[0].axis[kTheta], 0, ClassifyAxes(campaign, campaign.units)[kTheta]);
}

// Only a closed loop knows whole turns.
TEST(AxisClasses, AnAxisThatEndsWholeTurnsOffIsWrapped) {
  const std::uint64_t seed = TestSeed(83);
  FOCALFLEET_TRACE_SEED(seed);
  std::vector<Robot> robots = {
      {{{.is = AxisClass::kWrapped, .begins_deg = 0, .wraps = true}, Healthy()}}};
  const Campaign campaign = CampaignOf(seed, true, &robots);
  const AxisReport theta = ClassifyAxes(campaign, campaign.units)[kTheta];
  ExpectAsPlanted(robots[0].axis[kTheta], 0, theta);
  EXPECT_EQ(theta.wraps, kMoves - 1) << "no next move tells the turn of the last";
}

// A stuck axis is at one place, also where commands are more than half a turn away.
TEST(AxisClasses, AStuckAxisIsWhereItIsWhateverItsCommands) {
  const std::uint64_t seed = TestSeed(84);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "commands");
  for (const double stuck_deg : {-150.0, -20.0, 100.0, 150.0}) {
    std::vector<Robot> robots = {{{StuckAt(stuck_deg), Healthy()}}};
    Campaign campaign = CampaignOf(seed, true, &robots);
    for (double& cmd_deg : campaign.cmd_deg[kTheta]) cmd_deg = rng.Uniform(-160, 160);
    // No next move tells the turn of the last, which is therefore shorter than half a turn.
    campaign.cmd_deg[kTheta].back() = stuck_deg > 0 ? stuck_deg - 90 : stuck_deg + 90;
    ExpectAsPlanted(robots[0].axis[kTheta], 0, ClassifyAxes(campaign, campaign.units)[kTheta]);
  }
}

// Moves of 160 degrees turn 11: less than a tenth of what was asked, and more than a stall does.
TEST(AxisClasses, AStallIsTheSameForTheScale) {
  const std::uint64_t seed = TestSeed(85);
  FOCALFLEET_TRACE_SEED(seed);
  std::vector<Robot> robots = {{{Scaled(0.07, 0.07), Healthy()}}};
  Campaign campaign = CampaignOf(seed, true, &robots);
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const double from = campaign.from_deg[kTheta][row];
    const double asked = row % 2 == 0 ? 160 : -160;
    const double place_deg = from + 0.07 * asked;
    campaign.cmd_deg[kTheta][row] = from + asked;
    const PlacePoint at = PlaceOf(campaign.units[0], place_deg, campaign.cmd_deg[kPhi][row]);
    campaign.x_mm[row] = at.x_mm, campaign.y_mm[row] = at.y_mm;
    if (row + 1 < campaign.rows()) campaign.from_deg[kTheta][row + 1] = place_deg;
  }
  const AxisReport theta = ClassifyAxes(campaign, campaign.units)[kTheta];
  EXPECT_EQ(theta.stalls, 0u);
  EXPECT_EQ(Name(theta.is), "scale");
  ASSERT_TRUE(theta.scale_cw && theta.scale_ccw);
  EXPECT_NEAR(*theta.scale_cw, 0.07, 0.001);
  EXPECT_NEAR(*theta.scale_ccw, 0.07, 0.001);
}

// Repairs are listed by these classes: what a model explains is no less broken.
TEST(AxisClasses, AGivenModelLeavesTheClasses) {
  for (const bool closed : {false, true}) {
    std::vector<Robot> robots(7, {{Scaled(0.6, 0.6), Healthy()}});
    const Campaign campaign = CampaignOf(86, closed, &robots);
    const Diagnosis first = test::Verdicts(campaign);
    const Diagnosis again = test::Verdicts(campaign, {.before = &first.model});
    ASSERT_EQ(first.axes.size(), again.axes.size());
    // In an open loop the geometry that is fitted has a part of it, which phi then seems to turn.
    for (std::size_t k = 0; k < first.axes.size(); k += closed ? 1 : 2)
      EXPECT_EQ(Name(again.axes[k].is), Name(robots[k / 2].axis[k % 2].is)) << closed << ", " << k;
  }
}

TEST(AxisClasses, FewMovesAndMovesThatNobodySawTellNothing) {
  std::vector<Robot> robots = {{{Healthy(), Healthy()}}, {{Healthy(), Healthy()}}};
  Campaign campaign = CampaignOf(1, false, &robots);
  const auto hide = [&](std::size_t row) {
    campaign.x_mm[row] = campaign.y_mm[row] = std::numeric_limits<double>::quiet_NaN();
  };
  hide(20);
  for (std::size_t row = kMoves; row < 2 * kMoves; ++row) hide(row);
  std::vector<AxisReport> axes = ClassifyAxes(campaign, campaign.units);
  EXPECT_EQ(axes[kTheta].moves, kMoves - 3) << "the first, the hidden one and the one after it";
  EXPECT_EQ(axes[kTheta].is, AxisClass::kHealthy);
  EXPECT_EQ(axes[2 + kTheta].moves, 0u);
  EXPECT_EQ(axes[2 + kTheta].is, AxisClass::kUnknown);
  EXPECT_FALSE(axes[2 + kTheta].scale_cw || axes[2 + kTheta].scale_ccw);
  EXPECT_TRUE(std::isnan(axes[2 + kTheta].rms_um));
  for (std::size_t row = 5; row < kMoves; ++row) hide(row);
  axes = ClassifyAxes(campaign, campaign.units);
  EXPECT_EQ(axes[kTheta].moves, 4u);
  EXPECT_EQ(axes[kTheta].is, AxisClass::kUnknown);
}

TEST(AxisClasses, AreCountedByName) {
  const auto axis = [](AxisClass is) { return AxisReport{.is = is}; };
  EXPECT_THAT(
      CountByClass({axis(AxisClass::kStuck), axis(AxisClass::kHealthy), axis(AxisClass::kScale),
                    axis(AxisClass::kHealthy), axis(AxisClass::kSlipping),
                    axis(AxisClass::kWrapped), axis(AxisClass::kUnknown)}),
      ElementsAre(Pair("healthy", 2), Pair("scale", 1), Pair("slipping", 1), Pair("stuck", 1),
                  Pair("unknown", 1), Pair("wrapped", 1)));
  EXPECT_TRUE(CountByClass({}).empty());
}

}  // namespace
}  // namespace focalfleet::sim
