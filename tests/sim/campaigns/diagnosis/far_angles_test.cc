// Angles that reach a place, and residuals of errors that are arcs.
#include "sim/campaigns/diagnosis/model/far_angles.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using focalfleet::test::TestSeed;

CampaignUnit AnyUnit(Rng* rng) {
  CampaignUnit unit{.id = 1};
  unit.base_x_mm = rng->Uniform(-400, 400), unit.base_y_mm = rng->Uniform(-400, 400);
  for (const std::size_t axis : {kTheta, kPhi}) unit.arm_mm[axis] = rng->Uniform(1, 10);
  unit.zero_deg[kTheta] = rng->Uniform(-180, 180), unit.zero_deg[kPhi] = rng->Uniform(-20, 20);
  unit.gear[kTheta] = unit.gear[kPhi] = 337;
  unit.min_deg[kTheta] = -190, unit.max_deg[kTheta] = 190;
  unit.min_deg[kPhi] = 0, unit.max_deg[kPhi] = 180;
  return unit;
}

CampaignUnit UsualUnit() {
  CampaignUnit unit{.id = 1, .base_x_mm = 40, .base_y_mm = -25};
  unit.arm_mm[kTheta] = 3.1, unit.arm_mm[kPhi] = 2.9;
  unit.zero_deg[kTheta] = 20, unit.zero_deg[kPhi] = 0;
  unit.gear[kTheta] = unit.gear[kPhi] = 337;
  unit.min_deg[kTheta] = -190, unit.max_deg[kTheta] = 190;
  unit.min_deg[kPhi] = 0, unit.max_deg[kPhi] = 180;
  return unit;
}

// Predicted angles are off by nearly half a turn of theta, and by less of phi than the elbow's
// other side is away.
TEST(FindAngles, InvertsThePlaceOfAnyUnitInAnyPose) {
  const std::uint64_t seed = TestSeed(61);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "poses");
  for (int k = 0; k < 20'000; ++k) {
    const CampaignUnit unit = AnyUnit(&rng);
    const double theta = rng.Uniform(-190, 190);
    const double phi = rng.Uniform(5, 175) - unit.zero_deg[kPhi];
    const PlacePoint at = PlaceOf(unit, theta, phi);
    const AnglesToPlace found = FindAngles(unit, at.x_mm, at.y_mm, theta + rng.Uniform(-170, 170),
                                           phi + rng.Uniform(-2, 2));
    ASSERT_TRUE(found.reached) << k;
    ASSERT_NEAR(found.theta_deg, theta, 1e-9) << k << ", phi " << phi;
    ASSERT_NEAR(found.phi_deg, phi, 1e-9) << k;
  }
}

TEST(FindAngles, TakesTheElbowsSideThatPhiCanHave) {
  const CampaignUnit unit = UsualUnit();
  for (const double phi : {15.0, 40.0, 90.0, 165.0}) {
    const PlacePoint at = PlaceOf(unit, 30, phi);
    // Some predictions are nearer to the other side.
    for (const double predicted : {-10.0, phi - 60, phi, 179.0}) {
      const AnglesToPlace found = FindAngles(unit, at.x_mm, at.y_mm, 70, predicted);
      EXPECT_NEAR(found.phi_deg, phi, 1e-9) << "predicted " << predicted;
      EXPECT_NEAR(found.theta_deg, 30, 1e-9) << "predicted " << predicted;
    }
  }
  // With a range on both sides the prediction decides.
  CampaignUnit both = unit;
  both.min_deg[kPhi] = -180;
  const PlacePoint at = PlaceOf(both, 30, -50);
  EXPECT_NEAR(FindAngles(both, at.x_mm, at.y_mm, 30, -20).phi_deg, -50, 1e-9);
  EXPECT_NEAR(FindAngles(both, at.x_mm, at.y_mm, 30, 20).phi_deg, 50, 1e-9);
}

TEST(FindAngles, SaysWhereAPlaceIsOutOfReach) {
  const CampaignUnit unit = UsualUnit();
  const auto at_distance = [&](double mm) {
    return FindAngles(unit, unit.base_x_mm + mm, unit.base_y_mm, 11, 77);
  };
  EXPECT_TRUE(at_distance(5.9).reached);
  // A stretched arm reaches a place that is beyond it by noise.
  const AnglesToPlace stretched = at_distance(6.05);
  EXPECT_TRUE(stretched.reached);
  EXPECT_NEAR(stretched.phi_deg, 0, 1e-9);
  EXPECT_NEAR(stretched.theta_deg, -20, 1e-9);
  const AnglesToPlace beyond = at_distance(6.2);
  EXPECT_FALSE(beyond.reached);
  EXPECT_EQ(beyond.theta_deg, 11);
  EXPECT_EQ(beyond.phi_deg, 77);
}

// A unit whose axes are off by these angles after each move, and its residuals in um.
struct Residuals {
  Campaign campaign;
  CampaignFacts facts;
  UnitTrack track;
  std::vector<double> x_um, y_um;
};

using OffOfMove = std::function<double(std::size_t move)>;

// In a closed loop each move begins where the axis came to stand, whole turns included.
void Make(const OffOfMove (&off_deg)[2], bool closed, Residuals* made) {
  constexpr std::size_t kMoves = 21;
  Campaign& campaign = made->campaign;
  campaign.units = {UsualUnit()};
  campaign.first_row = {0, kMoves};
  Rng rng = Rng::Stream(7, "far angles");
  double last_deg[2] = {0, 60};
  for (std::size_t move = 0; move < kMoves; ++move) {
    campaign.move_id.push_back(static_cast<std::int64_t>(move) + 1);
    double true_deg[2];
    for (const std::size_t axis : {kTheta, kPhi}) {
      const double cmd = axis == kTheta ? rng.Uniform(-100, 100) : rng.Uniform(30, 95);
      campaign.from_deg[axis].push_back(last_deg[axis]);
      campaign.cmd_deg[axis].push_back(cmd);
      true_deg[axis] = cmd + off_deg[axis](move);
      last_deg[axis] = closed ? true_deg[axis] : cmd;
    }
    const PlacePoint at = PlaceOf(campaign.units[0], true_deg[kTheta], true_deg[kPhi]);
    campaign.x_mm.push_back(at.x_mm), campaign.y_mm.push_back(at.y_mm);
  }
  campaign.covariates.push_back({"from_measured", std::vector<double>(kMoves, closed ? 1 : 0)});
  made->facts = MakeFacts(campaign);
  made->track = MakeTrack(made->facts, 0, campaign.units[0]);
  for (std::size_t row = 0; row < kMoves; ++row) {
    made->x_um.push_back(1e3 * (campaign.x_mm[row] - made->track.fibre_x_mm[row]));
    made->y_um.push_back(1e3 * (campaign.y_mm[row] - made->track.fibre_y_mm[row]));
  }
}

void TakeFar(Residuals* residuals) {
  const UnitTrack& track = residuals->track;
  TakeFarAngles(track, {track.cmd_deg[kTheta].begin(), track.cmd_deg[kTheta].end()},
                {track.cmd_deg[kPhi].begin(), track.cmd_deg[kPhi].end()}, &residuals->x_um,
                &residuals->y_um);
}

// The angles that a residual stands for: the turn of the fibre per degree, inverted.
std::array<double, 2> AnglesOfResidual(const Residuals& residuals, std::size_t i) {
  constexpr double kPer = 1e3 * std::numbers::pi / 180;
  const UnitTrack& track = residuals.track;
  const double rx = track.reach_x_mm[i], ry = track.reach_y_mm[i];
  const double fx = track.elbow_x_mm[i] + rx, fy = track.elbow_y_mm[i] + ry;
  const double x = residuals.x_um[i] / kPer, y = residuals.y_um[i] / kPer;
  const double determinant = -fy * rx + ry * fx;
  return {(x * rx + y * ry) / determinant, (-fy * y - fx * x) / determinant};
}

TEST(TakeFarAngles, AnErrorThatAddsUpBeyondHalfATurnGoesOn) {
  Residuals made;
  Make({[](std::size_t move) { return 10.0 * static_cast<double>(move + 1); },
        [](std::size_t move) { return -0.5 * static_cast<double>(move % 3); }},
       false, &made);
  TakeFar(&made);
  for (std::size_t i = 0; i < made.track.moves; ++i) {
    const auto found = AnglesOfResidual(made, i);
    EXPECT_NEAR(found[kTheta], 10.0 * static_cast<double>(i + 1), 1e-7) << i;
    EXPECT_NEAR(found[kPhi], -0.5 * static_cast<double>(i % 3), 1e-7) << i;
  }
}

TEST(TakeFarAngles, AHomingForgetsTheTurnsSoFar) {
  Residuals made;
  const auto off = [](std::size_t move) { return 15.0 * static_cast<double>(move % 14 + 1); };
  Make({off, [](std::size_t) { return 0.0; }}, false, &made);
  made.campaign.covariates.push_back({"rehomed", std::vector<double>(made.campaign.rows(), 0)});
  made.campaign.covariates.back().values[14] = 1;
  made.facts = MakeFacts(made.campaign);
  made.track = MakeTrack(made.facts, 0, made.campaign.units[0]);
  TakeFar(&made);
  for (std::size_t i = 0; i < made.track.moves; ++i)
    EXPECT_NEAR(AnglesOfResidual(made, i)[kTheta], off(i), 1e-7) << i;
}

// The camera's angle at the next move tells the turns that a place does not.
TEST(TakeFarAngles, InAClosedLoopTheNextMoveTellsTheTurns) {
  Residuals made;
  const auto off = [](std::size_t move) { return move % 2 == 0 ? -200.0 : 340.0; };
  Make({off, [](std::size_t) { return 2.0; }}, true, &made);
  TakeFar(&made);
  for (std::size_t i = 0; i + 1 < made.track.moves; ++i) {
    const auto found = AnglesOfResidual(made, i);
    EXPECT_NEAR(found[kTheta], off(i), 1e-7) << i;
    EXPECT_NEAR(found[kPhi], 2, 1e-7) << i;
  }
}

TEST(TakeFarAngles, LeaveNearPlacesAndPlacesOutOfReachAsTheyAre) {
  Residuals made;
  Make({[](std::size_t) { return 1.0; }, [](std::size_t) { return 0.0; }}, false, &made);
  made.campaign.x_mm[3] = made.campaign.units[0].base_x_mm + 7;
  made.x_um[3] = 1e3 * (made.campaign.x_mm[3] - made.track.fibre_x_mm[3]);
  made.x_um[5] = made.y_um[5] = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> x_um = made.x_um, y_um = made.y_um;
  TakeFar(&made);
  for (std::size_t i = 0; i < made.track.moves; ++i) {
    if (i == 5) continue;
    EXPECT_EQ(made.x_um[i], x_um[i]) << i;
    EXPECT_EQ(made.y_um[i], y_um[i]) << i;
  }
  EXPECT_TRUE(std::isnan(made.x_um[5]) && std::isnan(made.y_um[5]));
}

}  // namespace
}  // namespace focalfleet::sim
