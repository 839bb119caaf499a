#include "daemon/status/status_json.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

using test::SmallFleet;

TEST(StatusJson, StatusCountsEveryUnitOnce) {
  const SmallFleet fleet;
  ShellFacts facts;
  facts.buses.resize(1);
  const Json status = StatusJson(fleet.View(), facts);
  EXPECT_EQ(status["units"], 3);
  EXPECT_EQ(status["phases"]["absent"], 3);
  EXPECT_EQ(status["positions"]["unknown"], 3);
  EXPECT_EQ(status["buses"].size(), 1u);
  EXPECT_EQ(status["configuration"]["unserved"].size(), 0u);
}

TEST(StatusJson, StatusTellsAlarmsAndTheNextStep) {
  const SmallFleet fleet;
  ShellFacts facts;
  facts.buses.resize(1);
  facts.alarms = {.open = 3, .muted = 1, .worst = "warning"};
  const Json status = StatusJson(fleet.View(), facts);
  EXPECT_EQ(status["alarms"], (Json{{"open", 3}, {"muted", 1}, {"worst", "warning"}}));
  EXPECT_EQ(status["next"], "focalfleet unit 1-3  (3 units are not heard)");
  facts.store_failing = true;
  EXPECT_EQ(StatusJson(fleet.View(), facts)["next"],
            "focalfleet alarms  (the store cannot be written)");
}

TEST(StatusJson, TheNextStepChoosesManyUnitsByStatesThatTheyAreIn) {
  constexpr std::uint32_t kUnits = 40;
  SmallFleet fleet(kUnits);
  EnableCommand gaps{.units = {}, .enabled = false, .reason = "not to be named"};
  for (std::uint32_t n = 0; n < kUnits; n += 2) gaps.units.push_back({n});
  const std::vector<Command> commands = {{.request = 1, .what = gaps}};
  fleet.Step({.now = {}, .commands = commands});
  ShellFacts facts;
  facts.buses.resize(1);
  EXPECT_EQ(StatusJson(fleet.View(), facts)["next"],
            "focalfleet unit --state silent --state absent  (20 units are not heard)")
      << "none of them was ever heard, so none is silent";
}

}  // namespace
}  // namespace focalfleet
