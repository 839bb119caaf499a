// Teeth that mesh deeper on one side of their gear, by physics of this file's own.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::TurnTheta;
using test::Verdicts;

// The gear's axis is a little off: 45 waves a turn, of a depth that goes round with it.
TEST(Mesh, TeethDeeperOnOneSideAreOneCause) {
  constexpr double kTeeth = 45, kDepth_deg = 0.06, kOff = 0.7;
  for (const std::uint64_t seed : {3u, 4u}) {
    SCOPED_TRACE(seed);
    Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = seed});
    std::vector<std::uint32_t> unit_of(campaign.rows());
    for (std::size_t u = 0; u < campaign.units.size(); ++u)
      for (std::size_t row = campaign.first_row[u]; row < campaign.first_row[u + 1]; ++row)
        unit_of[row] = campaign.units[u].id;
    TurnTheta(
        [&](std::size_t row) {
          const double turn = campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
          const double phase = 2.4 * unit_of[row];
          return kDepth_deg * (1 + kOff * std::cos(turn + phase)) *
                 std::sin(kTeeth * turn + 1.7 * phase);
        },
        &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].cause, "tooth_mesh");
    EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  }
}

}  // namespace
}  // namespace focalfleet::sim
