// A model that is given to a diagnosis takes its part away from the places, and no more.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/sim/campaigns/planting/planted_campaign.h"
#include "tests/sim/campaigns/planting/robots.h"

namespace focalfleet::sim {
namespace {

constexpr double kZeroOff_deg = 0.3;

// Robots without an effect, whose coordinator has a table with wrong zeros of theta: it turns the
// places that the camera sees into angles that are off, and its commands as much. The first move of
// a unit begins where a homing left it.
Campaign ByAWrongTable(std::vector<test::Robot> robots) {
  Campaign campaign = test::CampaignOf(91, true, &robots);
  for (CampaignUnit& unit : campaign.units) unit.zero_deg[kTheta] -= kZeroOff_deg;
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    if (row % test::kMoves == 0) continue;
    campaign.from_deg[kTheta][row] += kZeroOff_deg;
    campaign.cmd_deg[kTheta][row] += kZeroOff_deg;
  }
  return campaign;
}

TEST(GivenModel, IsOfTheUnitsAndNotOfTheCoordinator) {
  const Campaign campaign =
      ByAWrongTable(std::vector<test::Robot>(7, {{test::Healthy(), test::Healthy()}}));
  CampaignModel truth{.units = campaign.units};
  for (CampaignUnit& unit : truth.units) unit.zero_deg[kTheta] += kZeroOff_deg;
  const Diagnosis diagnosis = test::Verdicts(campaign, {.before = &truth});
  EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << test::Reported(diagnosis);
  double square = 0;
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    square += std::pow(diagnosis.x_before_um[row], 2) + std::pow(diagnosis.y_before_um[row], 2);
  // Noise of the camera at both ends of a move, and of the angles that it begins at.
  EXPECT_LT(std::sqrt(square / static_cast<double>(campaign.rows())), 15);
}

}  // namespace
}  // namespace focalfleet::sim
