// Names are compared with an empirical term that does better.
#include "sim/campaigns/diagnosis/search/beaten.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "sim/campaigns/diagnosis/score/fleet_groups.h"
#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

// A ripple of some units that no gear has.
Campaign Rippled(double order, double size_deg, std::uint64_t seed,
                 const std::vector<std::size_t>& units = {4, 13}) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = seed});
  std::vector<double> size_of_row(campaign.rows(), 0);
  for (const std::size_t unit : units)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      size_of_row[row] = size_deg;
  TurnTheta(
      [&](std::size_t row) {
        const double wave = order * campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
        return size_of_row[row] * std::sin(wave + 0.3 * std::sin(wave));
      },
      &campaign);
  return campaign;
}

TEST(Beaten, ARippleThatNoGearHasIsNoSeriesOfTeeth) {
  for (const double order : {5.0, 3.7}) {
    const Diagnosis diagnosis = Verdicts(Rippled(order, 0.1, 3));
    EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << order << Reported(diagnosis);
    for (const CauseFound& cause : diagnosis.causes)  // half a wave looks like a wrong zero
      EXPECT_EQ(cause.cause, "zero_offset") << order << Reported(diagnosis);
    ASSERT_EQ(diagnosis.unknown.size(), 1u);
    EXPECT_EQ(diagnosis.unknown[0].channel, "theta angle");
  }
}

// Static geometry takes a part of a structure that no effect explains.
bool IsGeometry(const CauseFound& cause) {
  return cause.cause == "zero_offset" || cause.cause == "base_offset" ||
         cause.cause == "arm_length";
}

void ExpectNamed(const std::vector<std::string>& names, const Diagnosis& diagnosis) {
  std::vector<std::string> named;
  for (const CauseFound& cause : diagnosis.causes) named.push_back(cause.cause);
  EXPECT_EQ(named, names) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
}

// A single unit's few moves pass a few crests of the ripple, which look like as many bumps.
TEST(Beaten, ARippleOfOneUnitIsNoTooth) {
  for (const std::uint64_t seed : {3u, 4u}) {
    SCOPED_TRACE(seed);
    const Diagnosis diagnosis = Verdicts(Rippled(3.7, 0.4, seed, {7}));
    EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_TRUE(IsGeometry(cause) || std::ranges::count(cause.candidates, "unknown") == 1)
          << Reported(diagnosis);
  }
}

// The teeth's wave is deeper on one side of the gear, differently in each unit. A ripple of the
// teeth's order is cheaper than both parts, and no better than the wave.
TEST(Beaten, ARippleOfTheTeethsOwnOrderIsTheTeeth) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 3});
  std::vector<double> phase_of_row;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    phase_of_row.resize(campaign.first_row[unit + 1], static_cast<double>(unit));
  TurnTheta(
      [&](std::size_t row) {
        const double turn = campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
        return 0.05 * std::sin(kOutputTeeth * turn + phase_of_row[row]) *
               (1 + 0.1 * std::cos(turn));
      },
      &campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  const Effect* effect = FindEffect("tooth_mesh");
  Templates teeth;
  effect->list(facts, &teeth);
  const auto of_all = [&](double spread_deg) {
    return Evidence{.sharing = Sharing::kUnit,
                    .has = std::vector<char>(campaign.units.size(), 1),
                    .spread = spread_deg};
  };
  for (Template& form : teeth) {
    form.effect = effect;
    if (form.axis == EffectAxis::kTheta && form.shape == kOutputTeeth)
      fit.model.terms.push_back(
          MakeTerm(form, of_all(form.form == 0 ? 0.06 : 0.006), GroupsOf(facts)));
  }
  ASSERT_EQ(fit.model.terms.size(), 2u);
  UpdateResiduals(&fit);
  StepFit(&fit);
  SettleFit(&fit, 3);
  Selection selection;
  selection.accepted.resize(2);
  DropBeaten(0.01, 1, &fit, &selection);
  EXPECT_EQ(fit.model.terms.size(), 2u);
}

TEST(Beaten, TwoPartsThatAreThereKeepTheirNames) {
  ExpectNamed(
      {"eccentricity", "tooth_damage"},
      Verdicts(Planted(
          {{.cause = "eccentricity", .amplitude = 0.1, .axis = "theta"},
           {.cause = "tooth_damage", .amplitude = 0.15, .axis = "theta", .unit_share = 0.3}},
          {.units = 24, .moves = 120, .seed = 4})));
}

// A curve replaces the scale of all units. The ripple, whose many amplitudes cost what they
// explain, is no part of it.
TEST(Beaten, ARippleBesideAScaleOfAllUnitsIsNoSeries) {
  ExpectNamed(
      {"gear_scale", "stage_ripple"},
      Verdicts(Planted(
          {{.cause = "gear_scale", .amplitude = 3e-4, .axis = "theta"},
           {.cause = "stage_ripple", .amplitude = 0.008, .axis = "theta", .unit_scatter = 0.3}},
          {.units = 24, .moves = 120, .seed = 4})));
}

TEST(Beaten, ANameBesideAStrongerStructureKeepsIts) {
  Campaign campaign = Planted({{.cause = "thermal_arm_growth", .amplitude = 6e-5}},
                              {.units = 12, .moves = 80, .seed = 3});
  TurnTheta(
      [&](std::size_t row) {
        const double turn = campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
        return 0.3 * std::sin(3.7 * turn);
      },
      &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_FALSE(diagnosis.unknown.empty());
  EXPECT_THAT(diagnosis.causes, testing::Contains(testing::Field(
                                    &CauseFound::cause, testing::Eq("thermal_arm_growth"))))
      << Reported(diagnosis);
}

// Play that opens suddenly as it grows cold, which no form of the library does.
TEST(Beaten, ABendOfItsOwnColumnIsTheCausesShape) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 3});
  const std::vector<double>& temperature =
      std::ranges::find(campaign.covariates, "temp_C", &Covariate::name)->values;
  std::vector<double> sorted = temperature;
  std::ranges::sort(sorted);
  const double cold_C = sorted[sorted.size() / 3];
  std::vector<double> side(campaign.rows(), 0);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const double step = campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row];
      side[row] = step > 0 ? 1 : step < 0 ? -1 : row > 0 ? side[row - 1] : 0;
    }
  TurnTheta(
      [&](std::size_t row) {
        return -0.04 * side[row] / (1 + std::exp(4 * (temperature[row] - cold_C)));
      },
      &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "thermal_backlash") << Reported(diagnosis);
}

// A theta angle that follows the square of a temperature that rises from session to session.
TEST(Beaten, WhatFollowsTheSquareOfTheTemperatureIsNotWear) {
  for (const std::uint64_t seed : {3u, 4u}) {
    SCOPED_TRACE(seed);
    Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = seed});
    const auto temperature = std::ranges::find(campaign.covariates, "temp_C", &Covariate::name);
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
        const auto move = static_cast<double>(row - campaign.first_row[unit]);
        temperature->values[row] = (move < 40   ? 2
                                    : move < 80 ? 12
                                                : 22) +
                                   5 * std::sin(0.35 * move);
      }
    TurnTheta([&](std::size_t row) { return 1e-4 * std::pow(temperature->values[row], 2); },
              &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_TRUE(IsGeometry(cause) || cause.candidates.size() > 1) << Reported(diagnosis);
  }
}

}  // namespace
}  // namespace focalfleet::sim
