#include "sim/campaigns/effects/empirical.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "protocol/base/rng.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;

TEST(Knots, GiveTheColumnsRanksBack) {
  const Campaign campaign = Planted({});
  const CampaignFacts facts = MakeFacts(campaign);
  for (const char* name : {"temp_C", "drive_amplitude", "elevation_deg", "theta_cmd_deg"}) {
    const FilledColumn& column = *facts.Find(name);
    const std::vector<RankKnot> knots = KnotsOf(column);
    ASSERT_GE(knots.size(), 2u) << name;
    EXPECT_LE(knots.size(), 65u) << name;
    for (std::size_t k = 1; k < knots.size(); ++k) {
      EXPECT_LT(knots[k - 1].value, knots[k].value) << name;
      EXPECT_LE(knots[k - 1].rank, knots[k].rank) << name;
    }
    double worst = 0;
    for (std::size_t row = 0; row < column.values.size(); ++row)
      worst =
          std::max(worst, std::abs(RankAt(knots, column.values[row]) - double{column.rank[row]}));
    EXPECT_LT(worst, 0.02) << name;
  }
}

TEST(Knots, OfFewValuesAreAllOfThem) {
  const Campaign campaign = Planted({});
  const CampaignFacts facts = MakeFacts(campaign);
  EXPECT_EQ(KnotsOf(*facts.Find("drive_amplitude")).size(), 3u);
  const Template look{
      .effect = &EmpiricalCurve(), .form = kThetaAngle, .covariate = "drive_amplitude"};
  EXPECT_EQ(WholeCurve(look, facts).columns, 2u);
}

TEST(Knots, TheEndHoldsBeyondTheRange) {
  const RankKnot knots[] = {{10, 0.1}, {20, 0.3}, {40, 0.9}};
  EXPECT_EQ(RankAt(knots, -5), 0.1);
  EXPECT_EQ(RankAt(knots, 10), 0.1);
  EXPECT_DOUBLE_EQ(RankAt(knots, 15), 0.2);
  EXPECT_DOUBLE_EQ(RankAt(knots, 30), 0.6);
  EXPECT_EQ(RankAt(knots, 40), 0.9);
  EXPECT_EQ(RankAt(knots, 1e9), 0.9);
}

// The same air gives the same place, whatever the other moves of the night were.
TEST(EmpiricalCurve, MeansTheSameValueInAnotherCampaign) {
  const Campaign one = Planted({});
  Campaign colder = one;
  for (Covariate& covariate : colder.covariates)
    if (covariate.name == "temp_C")
      for (std::size_t row = 1; row < covariate.values.size(); ++row) covariate.values[row] -= 8;
  const CampaignFacts facts = MakeFacts(one), colder_facts = MakeFacts(colder);
  const Template curve =
      WholeCurve({.effect = &EmpiricalCurve(), .form = kPhiAngle, .covariate = "temp_C"}, facts);
  const std::vector<double> amplitude = {0.05, -0.02, 0.01, 0.03, -0.01};
  const auto angle_of = [&](const Campaign& campaign, const CampaignFacts& of, std::size_t move) {
    PoseErrors errors;
    const UnitTrack track = MakeTrack(of, 0, campaign.units[0]);
    errors.Reset(track.moves);
    curve.effect->apply(track, curve, amplitude, &errors);
    return errors.angle_deg[kPhi][move];
  };
  EXPECT_NEAR(angle_of(one, facts, 0), angle_of(colder, colder_facts, 0), 1e-9);
  EXPECT_GT(std::abs(angle_of(one, facts, 7) - angle_of(colder, colder_facts, 7)), 1e-3);
}

TEST(Empirical, WhatIsHeldIsTheCurveOfTheMoveThatLedThere) {
  const Campaign campaign = PlantCampaign({.units = 8, .moves = 40, .seed = 3}).value();
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 2, campaign.units[2]);
  const std::vector<double> amplitude = {0.1};
  PoseErrors now, held;
  for (const auto& [channel, errors] : {std::pair(kThetaOdd, &now), std::pair(kThetaHeld, &held)}) {
    const Template look{
        .effect = &EmpiricalCurve(), .form = channel, .shape = 1, .covariate = "movers_on_rail"};
    errors->Reset(track.moves);
    look.effect->apply(track, look, amplitude, errors);
  }
  std::size_t moved = 0, stood = 0;
  for (std::size_t i = 1; i < track.moves; ++i) {
    if (track.restarts[i] != 0) continue;
    const bool moves = track.step_deg[kTheta][i] != 0;
    const double before = held.angle_deg[kTheta][i - 1];
    EXPECT_EQ(held.angle_deg[kTheta][i], moves ? now.angle_deg[kTheta][i] : before) << i;
    (moves ? moved : stood) += 1;
  }
  EXPECT_GT(moved, 5u);
  EXPECT_GT(stood, 5u);
}

TEST(Empirical, ACurveByTheSineTurnsWithTheArm) {
  const Campaign campaign = PlantCampaign({.units = 8, .moves = 40, .seed = 3}).value();
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 2, campaign.units[2]);
  const std::vector<double> amplitude = {0.1};
  const auto angles = [&](EmpiricalChannel channel) {
    const Template look{
        .effect = &EmpiricalCurve(), .form = channel, .shape = 1, .covariate = "elevation_deg"};
    PoseErrors errors;
    errors.Reset(track.moves);
    look.effect->apply(track, look, amplitude, &errors);
    return errors.angle_deg[kPhi];
  };
  const auto plain = angles(kPhiAngle), sine = angles(kPhiSine), cosine = angles(kPhiCosine);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double phi = (track.cmd_deg[kPhi][i] + campaign.units[2].zero_deg[kPhi]) / 180;
    EXPECT_NEAR(sine[i], plain[i] * std::sin(phi * std::numbers::pi), 1e-12);
    EXPECT_NEAR(cosine[i], plain[i] * std::cos(phi * std::numbers::pi), 1e-12);
  }
}

TEST(Empirical, ChannelsAreKnownByName) {
  for (int channel = 0; channel < kEmpiricalChannels; ++channel) {
    const Template look{.effect = &EmpiricalCurve(), .form = channel};
    EXPECT_EQ(ChannelNamed(ChannelOf(look)), channel);
  }
  EXPECT_FALSE(ChannelNamed("z"));
  EXPECT_EQ(FindEmpirical("backlash"), nullptr);
}

}  // namespace
}  // namespace focalfleet::sim
