#include "sim/campaigns/diagnosis/terms/step_rows.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kBefore = 8, kUndone = 10, kAfter = 11;  // moves

// The first unit was not seen after two moves.
Campaign SeenBeforeAndAfter() {
  Campaign campaign = test::Planted({}, {.units = 8, .moves = 40, .seed = 3});
  for (std::size_t move = kBefore + 1; move < kAfter; ++move)
    campaign.x_mm[move] = campaign.y_mm[move] = std::numeric_limits<double>::quiet_NaN();
  return campaign;
}

std::size_t MoveBeforeTheJump(const CampaignFacts& facts) {
  const Fit fit = test::StaticFit(facts);
  const StepRows rows(fit, 0);
  std::size_t row = 0;
  while (rows.move(row) < kAfter) ++row;
  EXPECT_EQ(rows.move(row), kAfter);
  EXPECT_EQ(rows.move(row - 1), kBefore);
  const std::size_t move = rows.MoveAfterRow(row);
  for (const std::size_t axis : {kTheta, kPhi})
    EXPECT_GT(rows.Column(axis, move, true).norm(), 0) << "the row shows a step in this move";
  return move;
}

TEST(StepRows, AStepMayBeInAnyMoveSinceTheRowBefore) {
  const Campaign campaign = SeenBeforeAndAfter();
  EXPECT_EQ(MoveBeforeTheJump(MakeFacts(campaign)), kBefore + 1);
}

TEST(StepRows, AStepThatAHomingOrAClosedLoopHasUndoneIsNotShown) {
  const Campaign campaign = SeenBeforeAndAfter();
  CampaignFacts homed = MakeFacts(campaign), closed = MakeFacts(campaign);
  homed.restarts[kUndone] = 1;
  EXPECT_EQ(MoveBeforeTheJump(homed), kUndone);
  closed.closed.assign(campaign.rows(), 0);
  closed.closed[kUndone] = 1;
  EXPECT_EQ(MoveBeforeTheJump(closed), kUndone);
}

// A folded arm does not show where theta stands, so that a slip may be in a later move.
TEST(StepRows, FoldedArmsShowNoTurnOfTheta) {
  Campaign campaign = test::Planted({}, {.units = 8, .moves = 40, .seed = 3});
  const CampaignUnit& unit = campaign.units[0];
  for (std::size_t move = kBefore; move <= kAfter; ++move) {
    const double phi_deg = move < kAfter ? 180 : 90;
    campaign.cmd_deg[kPhi][move] = campaign.from_deg[kPhi][move + 1] = phi_deg;
    const PlacePoint at = PlaceOf(unit, campaign.cmd_deg[kTheta][move], phi_deg);
    campaign.x_mm[move] = at.x_mm, campaign.y_mm[move] = at.y_mm;
  }
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = test::StaticFit(facts);
  const StepRows rows(fit, 0);
  ASSERT_EQ(rows.move(kBefore), kBefore);
  EXPECT_EQ(rows.RowThatShows(kTheta, kBefore), kAfter);
  EXPECT_EQ(rows.RowThatShows(kPhi, kBefore), kBefore);
}

}  // namespace
}  // namespace focalfleet::sim
