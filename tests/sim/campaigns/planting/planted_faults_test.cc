// Planted causes that no effect of the library makes are found again.
#include "sim/campaigns/planting/planted_faults.h"

#include <gmock/gmock.h>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::Verdicts;
using testing::HasSubstr;

struct Fault {
  PlantedEffect planted;
  double reported;  // amplitude
};

class EveryFault : public testing::TestWithParam<Fault> {};

TEST_P(EveryFault, IsNamed) {
  const Fault& fault = GetParam();
  std::vector<PlantedEffect> effects = {fault.planted};
  if (fault.planted.cause == "sensor_bias")
    effects.push_back({.cause = "thermal_arm_growth", .amplitude = 6e-5});
  const Campaign campaign = Planted(effects, {.units = 40, .moves = 80, .seed = 3});
  const Diagnosis diagnosis = Verdicts(campaign);
  const auto named = std::ranges::find(diagnosis.causes, fault.planted.cause, &CauseFound::cause);
  ASSERT_NE(named, diagnosis.causes.end()) << Reported(diagnosis);
  EXPECT_EQ(named->candidates.size(), 1u) << Reported(diagnosis);
  EXPECT_NEAR(named->amplitude, fault.reported, 0.3 * std::abs(fault.reported))
      << Reported(diagnosis);
}

INSTANTIATE_TEST_SUITE_P(
    Planted, EveryFault,
    testing::Values(Fault{{.cause = "step_loss", .amplitude = 4, .axis = "phi", .unit_share = 0.01},
                          1},
                    Fault{{.cause = "identity_swap", .amplitude = 2}, 2},
                    Fault{{.cause = "sensor_bias", .amplitude = -0.5, .unit_share = 0.2}, -0.5},
                    Fault{{.cause = "air_turbulence", .amplitude = 6}, 6},
                    Fault{{.cause = "centroid_bias", .amplitude = 8}, 8}),
    [](const auto& fault) { return fault.param.planted.cause; });

TEST(PlantedFaults, ALostMoveIsMissingUntilTheUnitIsHomed) {
  const PlantedOptions options{.units = 1, .moves = 200, .seed = 9, .homing_share = 0.03};
  const Campaign whole = Planted({}, options);
  const Campaign lost = Planted({{.cause = "lost_command", .amplitude = 1}}, options);
  const CampaignFacts facts = MakeFacts(whole);
  std::size_t first = 0, off = 0;
  for (std::size_t row = 0; row < whole.rows(); ++row) {
    const double away =
        std::hypot(lost.x_mm[row] - whole.x_mm[row], lost.y_mm[row] - whole.y_mm[row]);
    if (away < 1e-9) continue;
    if (off++ == 0) first = row;
    // The part that the move would have added is missing.
    const PlacePoint at =
        PlaceOf(whole.units[0], whole.cmd_deg[kTheta][row] - facts.step_deg[kTheta][first],
                whole.cmd_deg[kPhi][row] - facts.step_deg[kPhi][first]);
    EXPECT_NEAR(lost.x_mm[row], at.x_mm, 0.05) << row;
    EXPECT_NEAR(lost.y_mm[row], at.y_mm, 0.05) << row;
  }
  ASSERT_GT(off, 0u);
  EXPECT_EQ(off, EndOfHistory(MakeTrack(facts, 0, whole.units[0]), first) - first);
}

TEST(PlantedFaults, WhatThereIsNotIsRefused) {
  const auto why = [](const PlantedEffect& planted) {
    const auto campaign = PlantCampaign({.units = 3, .moves = 8, .effects = {planted}});
    return campaign ? std::string() : campaign.error().text;
  };
  EXPECT_THAT(why({.cause = "air_turbulence", .amplitude = 1, .axis = "phi"}),
              HasSubstr("not on axis 'phi'"));
  EXPECT_THAT(why({.cause = "step_loss", .amplitude = 1, .form = 2}), HasSubstr("no shapes"));
  EXPECT_THAT(why({.cause = "identity_swap", .amplitude = 2}), HasSubstr("not so many pairs"));
  for (const char* counted : {"lost_command", "step_loss", "identity_swap"})
    for (const double amplitude : {0.0, -1.0, 1.5, 1e30})
      EXPECT_THAT(why({.cause = counted, .amplitude = amplitude}), HasSubstr("whole number"));
  EXPECT_THAT(why({.cause = "stiction", .amplitude = 1, .axis = "theta", .form = 99}),
              HasSubstr("45  theta: until the next move; jumps from, deg, 0.4"));
}

}  // namespace
}  // namespace focalfleet::sim
