// Shapes between the listed ones, and shapes of units' own.
#include "sim/campaigns/diagnosis/search/candidate_shapes.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

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

constexpr double kAnyEvidence = -std::numeric_limits<double>::infinity();
constexpr double kHeight_deg = 0.2;

double PlaceOf_deg(std::uint32_t unit) { return std::fmod(222.5 * (unit + 1), 360); }

double Apart_deg(double a, double b) { return std::abs(std::remainder(a - b, 360)); }

// A damaged tooth elsewhere in each unit's pinion, broader than the library's.
void DamageTeeth(const std::function<bool(std::uint32_t unit)>& has, Campaign* campaign,
                 double width_deg = 15) {
  std::vector<std::size_t> unit_of(campaign->rows());
  for (std::size_t u = 0; u < campaign->units.size(); ++u)
    for (std::size_t row = campaign->first_row[u]; row < campaign->first_row[u + 1]; ++row)
      unit_of[row] = u;
  TurnTheta(
      [&](std::size_t row) {
        const CampaignUnit& unit = campaign->units[unit_of[row]];
        if (!has(unit.id)) return 0.0;
        const double at = PinionRatio(unit, kTheta) * campaign->cmd_deg[kTheta][row];
        return kHeight_deg *
               std::exp(-std::pow(Apart_deg(at, PlaceOf_deg(unit.id)) / width_deg, 2) / 2);
      },
      campaign);
}

TEST(OwnShapes, TeethElsewhereInEachUnitAreOneCause) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
  DamageTeeth([](std::uint32_t) { return true; }, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "tooth_damage");
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.causes[0].all_units);
  // The library's wider bump, of 20 degrees, fits best. On one of 15 degrees its height is
  // sqrt(2) 15 / hypot(15, 20) of the true one, by least squares.
  const double as_wide_deg = kHeight_deg * std::numbers::sqrt2 * 15 / 25;
  EXPECT_NEAR(diagnosis.causes[0].amplitude, as_wide_deg, 0.05 * kHeight_deg);
  ASSERT_EQ(diagnosis.model.terms.size(), 1u);
  const auto& shapes = diagnosis.model.terms[0].form.shape_of_unit;
  ASSERT_EQ(shapes.size(), campaign.units.size());
  // A few units hardly passed their tooth.
  EXPECT_GE(std::ranges::count_if(
                shapes,
                [](const auto& own) { return Apart_deg(own.second, PlaceOf_deg(own.first)) < 8; }),
            20);
}

TEST(OwnShapes, ATeethsLongMeshIsNothingElse) {
  for (const double width_deg : {10.0, 32.0}) {
    Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
    DamageTeeth([](std::uint32_t) { return true; }, &campaign, width_deg);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_FALSE(diagnosis.causes.empty()) << width_deg << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].cause, "tooth_damage");
    // Beside a mesh that is much longer than the library's, a little stays that a zero takes.
    for (std::size_t k = 1; k < diagnosis.causes.size(); ++k)
      EXPECT_EQ(diagnosis.causes[k].cause, "zero_offset") << width_deg << Reported(diagnosis);
  }
}

TEST(OwnShapes, FewUnitsAmongManyHaveTheirs) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 9});
  std::vector<std::uint32_t> damaged = {campaign.units[3].id, campaign.units[11].id,
                                        campaign.units[19].id};
  DamageTeeth([&](std::uint32_t unit) { return std::ranges::count(damaged, unit) != 0; },
              &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "tooth_damage");
  EXPECT_EQ(diagnosis.causes[0].candidates.size(), 1u) << Reported(diagnosis);
  std::ranges::sort(damaged);
  EXPECT_EQ(diagnosis.causes[0].units, damaged);
}

// The model is selected once more where the image moves.
TEST(OwnShapes, StayWhereTheImageMoves) {
  Campaign campaign =
      Planted({{.cause = "air_turbulence", .amplitude = 4}}, {.units = 24, .moves = 80, .seed = 8});
  DamageTeeth([](std::uint32_t) { return true; }, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  const auto teeth = std::ranges::find(diagnosis.causes, "tooth_damage", &CauseFound::cause);
  ASSERT_NE(teeth, diagnosis.causes.end()) << Reported(diagnosis);
  EXPECT_TRUE(teeth->all_units) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
}

TEST(OwnShapes, AUnitWithoutAShapeHasNoEffect) {
  const Campaign campaign = Planted({});
  const CampaignFacts facts = MakeFacts(campaign);
  for (const char* cause : {"tooth_damage", "command_quantisation"}) {
    Template form{.effect = FindEffect(cause), .axis = EffectAxis::kTheta};
    form.shape_of_unit[campaign.units[1].id] = 1;
    PoseErrors errors;
    for (const std::size_t unit : {0u, 1u}) {
      ApplyColumn(MakeTrack(facts, unit, campaign.units[unit]), form, 0, 1, &errors);
      const bool has =
          std::ranges::any_of(errors.angle_deg[kTheta], [](double e) { return e != 0; });
      EXPECT_EQ(has, unit == 1) << cause;
    }
  }
}

TEST(OwnShapes, WhoHasAChoiceOfShapesPaysForIt) {
  const Campaign campaign =
      Planted({{.cause = "tooth_damage", .amplitude = 0.1, .axis = "theta", .form = 5}});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  const FleetGroups groups = GroupsOf(facts);
  const Templates listed = ListTemplates(*FindEffect("tooth_damage"), facts);
  std::vector<CandidateShape> own =
      OwnShapes(ScoreTemplates(fit, listed), listed, facts, groups, 0);
  ASSERT_FALSE(own.empty());
  const Template& chosen = own[0].form;
  EXPECT_EQ(chosen.choices, 24);
  EXPECT_EQ(chosen.shape_of_unit.size(), campaign.units.size());
  Template free = chosen;
  free.choices = 1;
  const ScorePass pass = ScoreTemplates(fit, {chosen, free});
  const Evidence paid = Assess(pass.scores[0], chosen, groups);
  const Evidence unpaid = Assess(pass.scores[1], free, groups);
  const auto units = static_cast<double>(campaign.units.size());
  EXPECT_NEAR(unpaid.log_evidence - paid.log_evidence, units * std::log(24.0), 1);
  // No unit pays more than it has.
  EXPECT_LE(unpaid.chi_square - paid.chi_square, units * 2 * std::log(24.0) + 1e-9);
  EXPECT_GE(unpaid.chi_square - paid.chi_square, units * std::log(24.0));
  EXPECT_GT(paid.log_p, unpaid.log_p);
}

TEST(OwnShapes, NoiseHasNone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Campaign campaign = Planted({}, {.units = 24, .seed = seed});
    const CampaignFacts facts = MakeFacts(campaign);
    const Fit fit = StaticFit(facts);
    const Templates listed = ListTemplates(*FindEffect("tooth_damage"), facts);
    const FleetGroups groups = GroupsOf(facts);
    const ScorePass listed_pass = ScoreTemplates(fit, listed);
    EXPECT_TRUE(OwnShapes(listed_pass, listed, facts, groups, 0).empty());
    std::vector<CandidateShape> own = OwnShapes(listed_pass, listed, facts, groups, kAnyEvidence);
    EXPECT_FALSE(own.empty());
    RefineCandidateShapes(fit, groups, &own);
    for (const CandidateShape& one : own) {
      const ScorePass pass = ScoreTemplates(fit, {one.form});
      EXPECT_LE(Assess(pass.scores[0], one.form, groups).log_evidence, 0);
    }
  }
}

}  // namespace
}  // namespace focalfleet::sim
