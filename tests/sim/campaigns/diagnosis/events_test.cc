// Steps in single units' angles are slips by whole turns of the rotor, or moves that were not made.
#include "sim/campaigns/diagnosis/terms/events.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;
using testing::ElementsAre;

constexpr double kRadians = std::numbers::pi / 180;

// Moves the fibre as if theta were off by `by_deg` from the unit's row `from` on.
void TurnTheta(std::size_t unit, std::size_t from, std::size_t count, double by_deg,
               Campaign* campaign) {
  const CampaignUnit& u = campaign->units[unit];
  const double c = std::cos(by_deg * kRadians), s = std::sin(by_deg * kRadians);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = campaign->first_row[unit] + from + i;
    if (row >= campaign->first_row[unit + 1]) return;
    const double x = campaign->x_mm[row] - u.base_x_mm, y = campaign->y_mm[row] - u.base_y_mm;
    campaign->x_mm[row] = u.base_x_mm + c * x - s * y;
    campaign->y_mm[row] = u.base_y_mm + s * x + c * y;
  }
}

// The first move from `from` on that turns theta to the given side.
std::size_t MoveTo(const Campaign& campaign, std::size_t unit, std::size_t from, int side) {
  for (std::size_t i = from;; ++i) {
    const std::size_t row = campaign.first_row[unit] + i;
    if (row >= campaign.first_row[unit + 1]) return 0;
    if (side * (campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row]) > 5) return i;
  }
}

TEST(Events, ASlipOfTwoTurnsIsFoundInItsUnit) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 4});
  constexpr std::size_t kUnit = 5;
  const std::size_t move = MoveTo(campaign, kUnit, 30, 1);
  ASSERT_NE(move, 0u);
  const double turn_deg = 360 / campaign.units[kUnit].gear[kTheta];
  TurnTheta(kUnit, move, 1000, -2 * turn_deg, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "step_loss");
  EXPECT_EQ(diagnosis.causes[0].axis, "theta");
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(campaign.units[kUnit].id));
  ASSERT_EQ(diagnosis.model.events.size(), 1u);
  EXPECT_NEAR(diagnosis.model.events[0].step_deg, -2 * turn_deg, 1e-9);
}

TEST(Events, ASlipInAStretchedArmThatALaterOneUndoesIsNoLostCommand) {
  // Places of a stretched arm do not separate theta from phi, and theta makes small moves all
  // around.
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 4});
  constexpr std::size_t kUnit = 5, kFrom = 30, kSlipAt = 36, kBackAt = 81;
  const CampaignUnit& u = campaign.units[kUnit];
  const double turn_deg = 360 / u.gear[kTheta];
  Rng rng = Rng::Stream(4, "stretched");
  for (std::size_t i = kFrom; i < 120; ++i) {
    const std::size_t row = campaign.first_row[kUnit] + i;
    const bool stretched = i < 50 || (i >= 74 && i < 90);
    double* cmd[2] = {&campaign.cmd_deg[kTheta][row], &campaign.cmd_deg[kPhi][row]};
    if (stretched) *cmd[kTheta] = (i % 2 == 0 ? 0.3 : 0.0), *cmd[kPhi] = 0.5 - u.zero_deg[kPhi];
    for (const std::size_t axis : {kTheta, kPhi})
      campaign.from_deg[axis][row] = campaign.cmd_deg[axis][row - 1];
    const bool slipped = i >= kSlipAt && i < kBackAt;
    const PlacePoint at = PlaceOf(u, *cmd[kTheta] - (slipped ? turn_deg : 0), *cmd[kPhi]);
    campaign.x_mm[row] = at.x_mm + 0.003 * rng.Normal();
    campaign.y_mm[row] = at.y_mm + 0.003 * rng.Normal();
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "step_loss");
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(u.id));
  ASSERT_EQ(diagnosis.model.events.size(), 2u);
  EXPECT_NEAR(diagnosis.model.events[0].step_deg, -turn_deg, 1e-9);
  EXPECT_NEAR(diagnosis.model.events[1].step_deg, turn_deg, 1e-9);
}

TEST(Events, NoiseOfAFoldedArmIsNoSlip) {
  // With a folded arm theta moves the fibre next to nothing: noise of places is whole turns of its
  // angle.
  Campaign campaign = Planted({}, {.units = 100, .moves = 240, .seed = 4});
  Rng rng = Rng::Stream(4, "folded");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const CampaignUnit& u = campaign.units[unit];
    for (std::size_t i = 30; i < 240; ++i) {
      const std::size_t row = campaign.first_row[unit] + i;
      if (i % 35 < 7) campaign.cmd_deg[kPhi][row] = rng.Uniform(177, 178) - u.zero_deg[kPhi];
      for (const std::size_t axis : {kTheta, kPhi})
        campaign.from_deg[axis][row] = campaign.cmd_deg[axis][row - 1];
      const PlacePoint at = PlaceOf(u, campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]);
      campaign.x_mm[row] = at.x_mm + 0.003 * rng.Normal();
      campaign.y_mm[row] = at.y_mm + 0.003 * rng.Normal();
    }
  }
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  EXPECT_EQ(AddEvents(0.01, &fit), 0u);
}

TEST(Events, ALastMoveThatDidNotHappenIsALostCommand) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 4});
  std::vector<std::uint32_t> stayed;
  for (const std::size_t unit : {3u, 11u}) {
    const std::size_t last = campaign.first_row[unit + 1] - 1;
    // A long way, from where it was measured before.
    campaign.from_deg[kTheta][last] = campaign.cmd_deg[kTheta][last - 1];
    campaign.cmd_deg[kTheta][last] =
        campaign.from_deg[kTheta][last] + (campaign.from_deg[kTheta][last] > 0 ? -70 : 70);
    campaign.from_deg[kPhi][last] = campaign.cmd_deg[kPhi][last] = campaign.cmd_deg[kPhi][last - 1];
    campaign.x_mm[last] = campaign.x_mm[last - 1], campaign.y_mm[last] = campaign.y_mm[last - 1];
    stayed.push_back(campaign.units[unit].id);
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "lost_command");
  EXPECT_EQ(diagnosis.causes[0].units, stayed);
  EXPECT_EQ(diagnosis.causes[0].amplitude, 2);  // moves, of any axes
  EXPECT_EQ(diagnosis.outliers.rows, 0u);
}

// Most rows come after the last of three lost commands, and no single one explains them. The
// geometry that most rows agree on is not the unit's, and its arms are then far from their
// commands.
TEST(Events, CommandsLostOneSoonAfterTheOtherAreAllFound) {
  constexpr std::size_t kUnit = 7, kLost = 3;
  for (const std::uint64_t seed : {4u, 5u, 6u, 8u}) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = seed});
    const std::size_t first = campaign.first_row[kUnit];
    const CampaignUnit& unit = campaign.units[kUnit];
    double off_deg[2] = {0, 0};
    std::size_t lost = 0;
    for (std::size_t row = first + 12; row < campaign.first_row[kUnit + 1]; ++row) {
      double step_deg[2];
      for (const std::size_t axis : {kTheta, kPhi})
        step_deg[axis] = campaign.cmd_deg[axis][row] - campaign.from_deg[axis][row];
      if (lost < kLost && std::abs(step_deg[kTheta]) + std::abs(step_deg[kPhi]) > 10) {
        for (const std::size_t axis : {kTheta, kPhi}) off_deg[axis] -= step_deg[axis];
        ++lost;
      }
      const double theta = campaign.cmd_deg[kTheta][row], phi = campaign.cmd_deg[kPhi][row];
      const PlacePoint reported = PlaceOf(unit, theta, phi);
      const PlacePoint stands = PlaceOf(unit, theta + off_deg[kTheta], phi + off_deg[kPhi]);
      campaign.x_mm[row] += stands.x_mm - reported.x_mm;
      campaign.y_mm[row] += stands.y_mm - reported.y_mm;
    }
    ASSERT_EQ(lost, kLost);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].cause, "lost_command");
    EXPECT_EQ(diagnosis.causes[0].amplitude, kLost);
    EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(unit.id));
    EXPECT_EQ(diagnosis.outliers.rows, 0u);
  }
}

TEST(Events, AUnitThatDriftsStandsNowhereElse) {
  // Steps of any size can follow a slow drift everywhere.
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 2});
  constexpr std::size_t kUnit = 5;
  const std::size_t moves = campaign.first_row[kUnit + 1] - campaign.first_row[kUnit];
  for (std::size_t i = 0; i < moves; ++i)
    TurnTheta(kUnit, i, 1, 0.4 * static_cast<double>(i) / static_cast<double>(moves), &campaign);
  for (const UnknownFound& unknown : Verdicts(campaign).unknown)
    EXPECT_THAT(unknown.channel, testing::Not(testing::HasSubstr("stands elsewhere")));
}

TEST(Events, ACommandLostNearTheBeginningIsFoundWhateverTheTableSays) {
  // Few places come before the step, and the table is off by more than noise. Neither the fitted
  // geometry nor the table's is that of the rows before and after.
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 5});
  constexpr std::size_t kUnit = 7;
  const std::size_t first = campaign.first_row[kUnit];
  const auto step_deg = [&](std::size_t axis, std::size_t move) {
    return campaign.cmd_deg[axis][first + move] - campaign.from_deg[axis][first + move];
  };
  std::size_t lost = 3;
  while (std::abs(step_deg(kTheta, lost)) < 2) ++lost;
  ASSERT_LT(lost, 8u);
  const CampaignUnit unit = campaign.units[kUnit];
  const double theta_deg = step_deg(kTheta, lost), phi_deg = step_deg(kPhi, lost);
  for (std::size_t row = first + lost; row < campaign.first_row[kUnit + 1]; ++row) {
    const double theta = campaign.cmd_deg[kTheta][row], phi = campaign.cmd_deg[kPhi][row];
    const PlacePoint reported = PlaceOf(unit, theta, phi);
    const PlacePoint stands = PlaceOf(unit, theta - theta_deg, phi - phi_deg);
    campaign.x_mm[row] += stands.x_mm - reported.x_mm;
    campaign.y_mm[row] += stands.y_mm - reported.y_mm;
  }
  for (CampaignUnit& reported : campaign.units) {
    for (const std::size_t axis : {kTheta, kPhi}) reported.zero_deg[axis] += 0.2;
    reported.base_x_mm += 0.05;
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  const auto named = std::ranges::find(diagnosis.causes, "lost_command", &CauseFound::cause);
  ASSERT_NE(named, diagnosis.causes.end()) << Reported(diagnosis);
  EXPECT_THAT(named->units, ElementsAre(unit.id));
  EXPECT_EQ(diagnosis.outliers.rows, 0u);
}

TEST(Events, SlipsAreFoundAmongManyOutliers) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 6, .outlier_share = 0.02});
  std::vector<std::uint32_t> slipped;
  for (const std::size_t unit : {5u, 9u}) {
    const std::size_t move = MoveTo(campaign, unit, 90, 1);
    ASSERT_NE(move, 0u);
    TurnTheta(unit, move, 1000, -360 / campaign.units[unit].gear[kTheta], &campaign);
    slipped.push_back(campaign.units[unit].id);
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "step_loss");
  EXPECT_EQ(diagnosis.causes[0].units, slipped);
}

TEST(Events, AUnitThatSlipsAgainAndAgainIsNoNoisyUnit) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = 6});
  constexpr std::size_t kUnit = 5, kSlips = 9;
  const double turn_deg = 360 / campaign.units[kUnit].gear[kTheta];
  for (std::size_t k = 0; k < kSlips; ++k) {
    const int side = k % 3 == 0 ? -1 : 1;
    const std::size_t move = MoveTo(campaign, kUnit, 6 + 12 * k, side);
    ASSERT_NE(move, 0u);
    TurnTheta(kUnit, move, 1000, -side * turn_deg, &campaign);
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "step_loss");
  EXPECT_NEAR(diagnosis.causes[0].amplitude, kSlips,
              2);  // no slip is seen where poses do not show it
}

TEST(Events, TwoRowsOffByTwoTurnsAreOutliers) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 4});
  constexpr std::size_t kUnit = 5;
  const std::size_t move = MoveTo(campaign, kUnit, 30, 1);
  ASSERT_NE(move, 0u);
  TurnTheta(kUnit, move, 2, -2 * 360 / campaign.units[kUnit].gear[kTheta], &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_TRUE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_GE(diagnosis.outliers.rows, 1u);
}

TEST(Events, AMoveThatWasNotMadeIsALostCommand) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 4});
  constexpr std::size_t kUnit = 7;
  std::size_t move = 40;
  const auto row_of = [&](std::size_t i) { return campaign.first_row[kUnit] + i; };
  // A move that turns theta alone, so that turning the places back is exact.
  while (campaign.cmd_deg[kPhi][row_of(move)] != campaign.from_deg[kPhi][row_of(move)] ||
         std::abs(campaign.cmd_deg[kTheta][row_of(move)] -
                  campaign.from_deg[kTheta][row_of(move)]) < 2)
    ++move;
  const double step_deg =
      campaign.cmd_deg[kTheta][row_of(move)] - campaign.from_deg[kTheta][row_of(move)];
  TurnTheta(kUnit, move, 1000, -step_deg, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "lost_command");
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(campaign.units[kUnit].id));
}

// Moves the fibre as if both axes were off from the unit's row `from` on.
void StandElsewhere(std::size_t unit, std::size_t from, double theta_deg, double phi_deg,
                    Campaign* campaign) {
  CampaignUnit off = campaign->units[unit];
  off.zero_deg[kTheta] += theta_deg, off.zero_deg[kPhi] += phi_deg;
  for (std::size_t row = campaign->first_row[unit] + from; row < campaign->first_row[unit + 1];
       ++row) {
    const double theta = campaign->cmd_deg[kTheta][row], phi = campaign->cmd_deg[kPhi][row];
    const PlacePoint reported = PlaceOf(campaign->units[unit], theta, phi);
    const PlacePoint stands = PlaceOf(off, theta, phi);
    campaign->x_mm[row] += stands.x_mm - reported.x_mm;
    campaign->y_mm[row] += stands.y_mm - reported.y_mm;
  }
}

double StepAt(const Campaign& campaign, std::size_t unit, std::size_t move, std::size_t axis) {
  const std::size_t row = campaign.first_row[unit] + move;
  return campaign.cmd_deg[axis][row] - campaign.from_deg[axis][row];
}

// The first move from `from` on in which all of the units turn both axes far.
std::size_t MoveOfAll(const Campaign& campaign, std::vector<std::size_t> units, std::size_t from) {
  for (std::size_t move = from; move < campaign.first_row[1]; ++move)
    if (std::ranges::all_of(units, [&](std::size_t unit) {
          return std::abs(StepAt(campaign, unit, move, kTheta)) > 10 &&
                 std::abs(StepAt(campaign, unit, move, kPhi)) > 3;
        }))
      return move;
  return 0;
}

TEST(Events, ACommandOfOneAxisMayBeLost) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 6});
  constexpr std::size_t kUnit = 7;
  const std::size_t move = MoveOfAll(campaign, {kUnit}, 30);
  ASSERT_NE(move, 0u);
  StandElsewhere(kUnit, move, -StepAt(campaign, kUnit, move, kTheta), 0, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "lost_command");
  EXPECT_EQ(diagnosis.causes[0].axis, "theta");
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(campaign.units[kUnit].id));
  EXPECT_THAT(diagnosis.unknown, testing::IsEmpty());
}

// Units 0 and 1 of the lattice are next to each other.
TEST(Events, NeighboursThatStopShortInOneMoveHaveTouched) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 200, .seed = 6});
  const std::size_t move = MoveOfAll(campaign, {0, 1}, 30);
  ASSERT_NE(move, 0u);
  for (const std::size_t unit : {std::size_t{0}, std::size_t{1}})
    StandElsewhere(unit, move, -0.31 * StepAt(campaign, unit, move, kTheta),
                   -0.4 * StepAt(campaign, unit, move, kPhi), &campaign);
  const Diagnosis diagnosis = Diagnose(campaign, {});
  ASSERT_FALSE(diagnosis.causes.empty());
  EXPECT_EQ(diagnosis.causes[0].cause, "collision_contact");
  // Their angles are known to some thousandths of a degree: the rest is a zero's.
  for (std::size_t k = 1; k < diagnosis.causes.size(); ++k)
    EXPECT_EQ(diagnosis.causes[k].cause, "zero_offset") << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(campaign.units[0].id, campaign.units[1].id));
  EXPECT_THAT(diagnosis.unknown, testing::IsEmpty());
  EXPECT_LT(diagnosis.gain.rms_after_um, 20);
}

// Two turns lost by unit 0, in the move in which unit 1 stops short.
Campaign StoppedAfterTurns(std::size_t move) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 200, .seed = 6});
  const double turns_deg = 2 * 360 / campaign.units[0].gear[kTheta];
  StandElsewhere(0, move, std::copysign(turns_deg, -StepAt(campaign, 0, move, kTheta)), 0,
                 &campaign);
  StandElsewhere(1, move, -0.31 * StepAt(campaign, 1, move, kTheta),
                 -0.4 * StepAt(campaign, 1, move, kPhi), &campaign);
  return campaign;
}

TEST(Events, AUnitThatANeighbourStopsAfterWholeTurnsHasTouchedIt) {
  const std::size_t move =
      MoveOfAll(Planted({}, {.units = 24, .moves = 200, .seed = 6}), {0, 1}, 30);
  ASSERT_NE(move, 0u);
  const Campaign campaign = StoppedAfterTurns(move);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "collision_contact");
  EXPECT_THAT(diagnosis.causes[0].units, ElementsAre(campaign.units[0].id, campaign.units[1].id));
}

// Arms that met on their way may end far apart: their gap there is no evidence about others.
TEST(Events, SlipsOfOthersBesideAContactAreSlips) {
  const Campaign plain = Planted({}, {.units = 24, .moves = 200, .seed = 6});
  const CampaignFacts facts = MakeFacts(plain);
  const std::vector<double>& gap_mm = facts.Find(kArmGap)->values;
  const auto is_apart = [&](std::size_t unit, std::size_t move) {
    return gap_mm[plain.first_row[unit] + move] > kThickestArm * facts.pitch_mm;
  };
  std::size_t move = MoveOfAll(plain, {0, 1}, 30);
  while (move != 0 && !(is_apart(0, move) && is_apart(1, move)))
    move = MoveOfAll(plain, {0, 1}, move + 1);
  ASSERT_NE(move, 0u);
  Campaign campaign = StoppedAfterTurns(move);
  std::vector<std::uint32_t> slipped;
  for (const std::size_t unit : {8u, 12u, 17u, 20u}) {
    std::size_t at = 60;
    while (!is_apart(unit, at) || std::abs(StepAt(campaign, unit, at, kTheta)) < 20) ++at;
    const double turns_deg = 2 * 360 / campaign.units[unit].gear[kTheta];
    StandElsewhere(unit, at, std::copysign(turns_deg, -StepAt(campaign, unit, at, kTheta)), 0,
                   &campaign);
    slipped.push_back(campaign.units[unit].id);
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  for (const CauseFound& cause : diagnosis.causes) {
    if (cause.cause == "step_loss")
      EXPECT_THAT(cause.units, testing::ElementsAreArray(slipped)) << Reported(diagnosis);
    else
      EXPECT_EQ(cause.cause, "collision_contact") << Reported(diagnosis);
  }
  EXPECT_EQ(diagnosis.causes.size(), 2u) << Reported(diagnosis);
}

TEST(Events, AUnitThatStopsShortAloneIsUnknown) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 6});
  constexpr std::size_t kUnit = 3;
  const std::size_t move = MoveOfAll(campaign, {kUnit}, 30);
  ASSERT_NE(move, 0u);
  StandElsewhere(kUnit, move, -0.31 * StepAt(campaign, kUnit, move, kTheta),
                 -0.12 * StepAt(campaign, kUnit, move, kPhi), &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_EQ(cause.cause, "zero_offset") << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.unknown.empty());
  EXPECT_THAT(diagnosis.unknown[0].channel, testing::HasSubstr("stands elsewhere since move"));
}

}  // namespace
}  // namespace focalfleet::sim
