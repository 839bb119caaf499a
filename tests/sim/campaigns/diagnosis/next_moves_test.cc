// Moves that are proposed to separate causes are compared with their effect.
#include "sim/campaigns/diagnosis/design/next_moves.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;
using testing::Each;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

// Theta moves in steps of one length from the stop, repeatedly, by all units at once. Such arcs
// show what arcs over the range show, and nothing else.
Campaign Arcs(double step_deg, std::vector<PlantedEffect> effects, std::uint64_t seed) {
  PlantedOptions options{.units = 6, .moves = 1, .seed = seed, .noise_um = 2};
  const Campaign first = Planted({}, options);
  std::vector<ProposedMove> moves;
  for (int k = 0; k < 48; ++k)
    moves.push_back({.theta_fp_deg = -60 + step_deg * (k % 8),
                     .phi_fp_deg = 80,
                     .conditions = {.home_first = k % 8 == 0}});
  options.next = SpreadOver(first.units, moves);
  return Planted(std::move(effects), options);
}

const CauseFound* Find(const Diagnosis& diagnosis, std::string_view cause) {
  const auto found = std::ranges::find(diagnosis.causes, cause, &CauseFound::cause);
  return found == diagnosis.causes.end() ? nullptr : &*found;
}

bool AsksForADrive(const ProposedMove& move) { return move.conditions.drive_amplitude != 1; }

TEST(NextMoves, ConfusionIsHowFarTwoTracesStandApart) {
  EXPECT_DOUBLE_EQ(ConfusionAt(0), 0.5);
  EXPECT_NEAR(ConfusionAt(10.8), 0.05, 5e-4);
  EXPECT_NEAR(ConfusionAt(21.6), 0.01, 2e-4);
  EXPECT_NEAR(ConfusionAt(38), 0.001, 1e-4);
}

// The first form of a cause on theta, one amplitude for all units, fitted.
Fit FittedWith(const char* cause, Memory memory, const CampaignFacts& facts) {
  Fit fit = StaticFit(facts);
  ModelTerm term;
  for (const Template& form : ListTemplates(*FindEffect(cause), facts))
    if (form.axis == EffectAxis::kTheta && form.memory == memory) {
      term.form = form;
      break;
    }
  term.group_of_unit.assign(facts.campaign->units.size(), 0);
  term.amplitude = term.sigma = {0};
  fit.model.terms.push_back(std::move(term));
  StepFit(&fit);
  SettleFit(&fit, 2);
  return fit;
}

CauseFound Ambiguous(const char* cause, const char* rival) {
  CauseFound reported = CauseNamed(cause);
  reported.axis = "theta";
  reported.candidates.emplace_back(rival);
  return reported;
}

// A travel that is lost at each move is a share of the travel as long as all moves are alike.
TEST(NextMoves, ShortMovesTellAConstantTravelFromAScale) {
  const Campaign campaign =
      Arcs(15, {{.cause = "gear_scale", .amplitude = 0.003, .axis = "theta"}}, 3);
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = FittedWith("gear_scale", Memory::kChain, facts);
  const NextMoves next = ProposeMoves(fit, {Ambiguous("gear_scale", "ramp_travel")});
  ASSERT_THAT(next.prospects, SizeIs(1));
  EXPECT_GT(next.prospects[0].d, 30);
  EXPECT_LE(next.moves.size(), kNextMovesMax);
  std::set<double> lengths;
  for (std::size_t m = 1; m < next.moves.size(); ++m)
    lengths.insert(std::abs(next.moves[m].theta_fp_deg - next.moves[m - 1].theta_fp_deg));
  EXPECT_TRUE(
      std::ranges::any_of(lengths, [](double length) { return length < 5 || length > 30; }));
  EXPECT_THAT(next.moves,
              Each(Field(&ProposedMove::separates, testing::StrEq("gear_scale | ramp_travel"))));
}

TEST(NextMoves, MadeAndMeasuredTheyDecide) {
  for (const std::uint64_t seed : {11u, 12u, 13u}) {
    const std::vector<PlantedEffect> effects = {
        {.cause = "ramp_travel", .amplitude = 0.05, .axis = "theta"}};
    PlantedOptions options{.units = 6, .moves = 10, .seed = seed, .noise_um = 3};
    const Campaign few = Planted(effects, options);
    const Diagnosis before = Diagnose(few, {.with_gain = false});
    if (before.next.moves.empty()) continue;  // these few moves decide already
    options.next = SpreadOver(few.units, before.next.moves);
    const Campaign more = Planted(effects, options);
    ASSERT_EQ(more.rows(), few.rows() + few.units.size() * before.next.moves.size());
    const Diagnosis after = Diagnose(more, {.with_gain = false, .with_next_moves = false});
    const CauseFound* found = Find(after, "ramp_travel");
    ASSERT_NE(found, nullptr) << "seed " << seed;
    EXPECT_THAT(found->candidates, SizeIs(1)) << "seed " << seed;
  }
}

// Play and the lag of a loaded rotor are the same at one drive.
TEST(NextMoves, AskForTheDriveWhereOnlyItDecides) {
  Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1, .axis = "theta"}},
                              {.units = 6, .moves = 60, .seed = 5});
  std::erase_if(campaign.covariates,
                [](const Covariate& column) { return column.name == "drive_amplitude"; });
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = FittedWith("backlash", Memory::kHold, facts);
  EXPECT_THAT(ProposeMoves(fit, {CauseNamed("backlash")}).moves, IsEmpty());
  const NextMoves next = ProposeMoves(fit, {Ambiguous("backlash", "load_angle_lag")});
  EXPECT_TRUE(std::ranges::any_of(next.moves, AsksForADrive));
  ASSERT_THAT(next.prospects, SizeIs(1));
  EXPECT_GT(next.prospects[0].d, 30);
}

// Two units have no gradient between them: their rows cannot test a term of the plate.
TEST(NextMoves, TermsWhoseColumnsFewUnitsLackStayOut) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1, .axis = "theta"}},
                                    {.units = 20, .moves = 60, .seed = 5});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = FittedWith("backlash", Memory::kHold, facts);
  std::vector<std::uint32_t>& has = fit.model.terms[0].group_of_unit;
  std::fill(has.begin() + 2, has.end(), kNoGroup);
  ModelTerm bend;
  bend.form = ListTemplates(*FindEffect("plate_gradient"), facts).front();
  bend.group_of_unit.assign(campaign.units.size(), 0);
  bend.amplitude.assign(bend.form.columns, 1e-6);
  bend.sigma.assign(bend.form.columns, 1e-7);
  fit.model.terms.insert(fit.model.terms.begin(), bend);
  const NextMoves next = ProposeMoves(fit, {Ambiguous("backlash", "load_angle_lag")});
  EXPECT_THAT(next.prospects, SizeIs(1));
  CauseFound plate = Ambiguous("plate_gradient", "camera_similarity");
  plate.axis = "none";
  EXPECT_THAT(ProposeMoves(fit, {plate}).moves, testing::SizeIs(testing::Le(kNextMovesMax)));
}

TEST(NextMoves, ThereAreNoneWhereNothingIsConfusable) {
  const Diagnosis diagnosis =
      Diagnose(Planted({{.cause = "eccentricity", .amplitude = 0.1, .axis = "theta"}},
                       {.units = 24, .moves = 60, .seed = 7}),
               {.with_gain = false});
  ASSERT_EQ(diagnosis.verdict, Verdict::kExplained);
  EXPECT_THAT(diagnosis.next.moves, IsEmpty());
  EXPECT_THAT(diagnosis.next.prospects, IsEmpty());
}

// All rows of the units that have a term may be set aside.
TEST(NextMoves, OfATermThatNobodySeenHasAreNone) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1, .axis = "theta"}},
                                    {.units = 24, .moves = 40});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = FittedWith("backlash", Memory::kHold, facts);
  std::vector<std::uint32_t>& has = fit.model.terms[0].group_of_unit;
  std::fill(has.begin() + 1, has.end(), kNoGroup);
  std::fill_n(fit.weight.begin(), campaign.first_row[1], 0.0);
  const NextMoves next = ProposeMoves(fit, {Ambiguous("backlash", "friction_windup")});
  EXPECT_THAT(next.moves, IsEmpty());
  EXPECT_THAT(next.inseparable, testing::ElementsAre(std::pair("backlash", "friction_windup")));
}

TEST(Ahead, AUnitGoesWhereItIsSentAndStaysWhereItIsNot) {
  const Campaign made = Planted({}, {.units = 8, .moves = 10, .seed = 2});
  const std::vector<ProposedMove> moves = {
      {.theta_fp_deg = 0, .phi_fp_deg = 90},
      {.theta_fp_deg = 30, .phi_fp_deg = 90, .every = 4, .conditions = {.drive_amplitude = 0.6}},
      {.theta_fp_deg = 0, .phi_fp_deg = 90, .conditions = {.delay_s = 30, .home_first = true}}};
  const Campaign ahead = Ahead(made, SpreadOver(made.units, moves));
  ASSERT_TRUE(Validate(ahead));
  std::size_t sent = 0;
  for (std::size_t u = 0; u < ahead.units.size(); ++u) {
    const std::size_t end = ahead.first_row[u + 1];
    ASSERT_EQ(end - ahead.first_row[u], 13u);
    for (std::size_t row = end - 3; row < end; ++row) {
      EXPECT_EQ(ahead.from_deg[kTheta][row], ahead.cmd_deg[kTheta][row - 1]);
      EXPECT_EQ(ahead.from_deg[kPhi][row], ahead.cmd_deg[kPhi][row - 1]);
    }
    sent += ahead.cmd_deg[kTheta][end - 2] == 30 ? 1u : 0u;
    EXPECT_EQ(ahead.Find("drive_amplitude")[end - 2], 0.6);
    EXPECT_EQ(ahead.Find("movers_on_rail")[end - 2], 2);
    EXPECT_EQ(ahead.Find("movers_on_rail")[end - 1], 8);
    EXPECT_EQ(ahead.Find("rehomed")[end - 1], 1);
    EXPECT_EQ(ahead.Find("temp_C")[end - 1], ahead.Find("temp_C")[end - 4]);
    EXPECT_GT(ahead.Find("t_s")[end - 1], ahead.Find("t_s")[end - 2] + 30);
  }
  EXPECT_EQ(sent, 2u);
}

TEST(Ahead, AnglesStayClearOfTheEndsWhateverTheZero) {
  CampaignUnit unit = Planted({}, {.units = 1, .moves = 2}).units[0];
  for (const double zero : {-725.0, -170.0, 0.0, 33.0, 200.0}) {
    unit.zero_deg[kTheta] = zero;
    for (const double stance : {-150.0, -40.0, 0.0, 120.0}) {
      const auto spread = SpreadOver({unit}, {{.theta_fp_deg = stance, .phi_fp_deg = 200}});
      const auto& to = spread.at(0).to_deg.at(0);
      ASSERT_TRUE(to);
      EXPECT_GE((*to)[kTheta], unit.min_deg[kTheta] + 3);
      EXPECT_LE((*to)[kTheta], unit.max_deg[kTheta] - 3);
      EXPECT_EQ((*to)[kPhi], unit.max_deg[kPhi] - 3);
      const double off = std::remainder((*to)[kTheta] + zero - stance, 360);
      EXPECT_LT(std::abs(off), 10) << zero << " " << stance;  // 380 degrees less two margins
    }
  }
}

}  // namespace
}  // namespace focalfleet::sim
