// A slip and a cause of single units that have the same effect on the rows.
#include "sim/campaigns/diagnosis/steps_instead.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::size_t kMoves = 60, kUnit = 5, kHomedAt = 40;

// A unit makes long moves, is homed, and makes short ones to the end, but for `long_again`. Where
// its moves are short, its theta is off by `off_turns` of the rotor's turns.
Campaign LongThenShort(double off_turns, std::size_t long_again = kMoves) {
  Campaign campaign = Planted({}, {.units = 24, .moves = kMoves, .seed = 4});
  const CampaignUnit& u = campaign.units[kUnit];
  campaign.covariates.push_back({"rehomed", std::vector<double>(campaign.rows(), 0)});
  campaign.covariates.back().values[campaign.first_row[kUnit] + kHomedAt] = 1;
  Rng rng = Rng::Stream(4, "short moves");
  for (std::size_t i = 0; i < kMoves; ++i) {
    const std::size_t row = campaign.first_row[kUnit] + i;
    const auto k = static_cast<double>(i);
    double theta =
        i < kHomedAt ? (i % 2 == 0 ? 60 : -60) + 30 * std::cos(2.3 * k) : -40 + 4 * (k - kHomedAt);
    if (i >= long_again && i < long_again + 3) theta -= i % 2 == 0 ? 30 : 60;
    const double phi = i < kHomedAt ? 90 + 50 * std::sin(1.7 * k) : 80;
    const bool is_at_stop = i == 0 || i == kHomedAt;
    campaign.from_deg[kTheta][row] =
        is_at_stop ? u.min_deg[kTheta] : campaign.cmd_deg[kTheta][row - 1];
    campaign.from_deg[kPhi][row] = is_at_stop ? u.min_deg[kPhi] : campaign.cmd_deg[kPhi][row - 1];
    campaign.cmd_deg[kTheta][row] = theta, campaign.cmd_deg[kPhi][row] = phi;
    const bool is_short = std::abs(theta - campaign.from_deg[kTheta][row]) < 5;
    const double off_deg = is_short ? off_turns * 360 / u.gear[kTheta] : 0;
    const PlacePoint at = PlaceOf(u, theta + off_deg, phi);
    campaign.x_mm[row] = at.x_mm + 0.003 * rng.Normal();
    campaign.y_mm[row] = at.y_mm + 0.003 * rng.Normal();
  }
  return campaign;
}

std::vector<std::string_view> StepsInsteadOf(const char* cause, std::size_t of_unit,
                                             const Campaign& campaign) {
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  ModelTerm term;
  term.form = {.effect = FindEffect(cause), .axis = EffectAxis::kTheta, .shape = 5};
  term.sharing = Sharing::kUnit;
  term.group_of_unit.assign(campaign.units.size(), kNoGroup);
  term.group_of_unit[of_unit] = 0;
  term.amplitude = {0}, term.sigma = {0};
  fit.model.terms.push_back(term);
  StepFit(&fit);
  SettleFit(&fit, 3);
  Selection selection;
  selection.accepted.resize(1);
  CompareWithSteps(fit, 0.01, &selection);
  std::vector<std::string_view> names;
  for (const Rival& rival : selection.accepted[0].rivals) names.push_back(rival.cause);
  return names;
}

TEST(StepsInstead, OfATurnSinceTheFirstShortMove) {
  const Campaign campaign = LongThenShort(-1);
  EXPECT_THAT(StepsInsteadOf("mode_threshold", kUnit, campaign), ElementsAre("step_loss"));
  // The steps do not explain another unit's error.
  EXPECT_THAT(StepsInsteadOf("mode_threshold", kUnit + 1, campaign), IsEmpty());
}

TEST(StepsInstead, NotWhereLongMovesBetweenAreRight) {
  EXPECT_THAT(StepsInsteadOf("mode_threshold", kUnit, LongThenShort(-1, 52)), IsEmpty());
}

TEST(StepsInstead, NotOfLessThanATurn) {
  EXPECT_THAT(StepsInsteadOf("mode_threshold", kUnit, LongThenShort(-0.6)), IsEmpty());
}

TEST(StepsInstead, ASlipAtTheFirstShortMoveHasItAmongItsCandidates) {
  const Campaign campaign = LongThenShort(-1);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].units, Contains(campaign.units[kUnit].id));
  EXPECT_THAT(diagnosis.causes[0].candidates, Contains("step_loss")) << Reported(diagnosis);
}

// A unit's step of 0.3 degrees was taken before the causes were known. The planted step may be
// there or not. `also`: neighbours that are off by a degree since the same move.
std::size_t StepsLeft(double planted_deg, const std::vector<std::size_t>& also = {}) {
  Campaign campaign = Planted({}, {.units = 24, .moves = kMoves, .seed = 4});
  const std::size_t move = 20;
  TurnTheta(
      [&](std::size_t row) {
        const auto stands_off = [&](std::size_t unit) {
          return row >= campaign.first_row[unit] + move && row < campaign.first_row[unit + 1];
        };
        return stands_off(kUnit) ? planted_deg : std::ranges::any_of(also, stands_off) ? 1 : 0;
      },
      &campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  ModelTerm term;
  term.form = {.effect = FindEffect("backlash"), .axis = EffectAxis::kPhi};
  term.group_of_unit.assign(campaign.units.size(), 0);
  term.amplitude = {0}, term.sigma = {0};
  fit.model.terms.push_back(term);
  fit.model.events.push_back({kUnit, campaign.first_row[kUnit] + move, kTheta, true, 0.3});
  for (const std::size_t unit : also)
    fit.model.events.push_back({unit, campaign.first_row[unit] + move, kTheta, true, 1});
  StepFit(&fit);
  SettleFit(&fit, 3);
  DropNeedlessSteps(&fit);
  return fit.model.events.size();
}

TEST(StepsInstead, WhatTheModelDoesAsWellWithoutIsNone) {
  EXPECT_EQ(StepsLeft(0), 0u);
  EXPECT_EQ(StepsLeft(0.3), 1u);
}

// The weaker half of a contact is not tried alone: without it the other would have met no
// neighbour.
TEST(StepsInstead, HalfOfAContactStays) {
  const Campaign campaign = Planted({}, {.units = 24, .moves = kMoves, .seed = 4});
  const auto apart_mm = [&](std::size_t unit) {
    return std::hypot(campaign.units[unit].base_x_mm - campaign.units[kUnit].base_x_mm,
                      campaign.units[unit].base_y_mm - campaign.units[kUnit].base_y_mm);
  };
  std::vector<std::size_t> others;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    if (unit != kUnit) others.push_back(unit);
  std::ranges::sort(others, {}, apart_mm);
  EXPECT_EQ(StepsLeft(0, {others.front()}), 2u);
  EXPECT_EQ(StepsLeft(0, {others.back()}), 1u);
}

}  // namespace
}  // namespace focalfleet::sim
