#include "daemon/status/state_rows.h"

#include <gtest/gtest.h>

#include "daemon/control/messages.h"
#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

TEST(StateRows, AreTextWithARowForEachUnit) {
  const test::SmallFleet fleet;
  const StateRows rows = TakeStateRows(fleet.View());
  const Json state = Json::parse(StateText(*rows), nullptr, false);
  ASSERT_TRUE(state.is_object());
  ASSERT_EQ(state["rows"].size(), 3u);
  const Json& row = state["rows"][1];
  EXPECT_EQ(row["unit_id"], 2);
  EXPECT_EQ(row["phase"], "absent");
  EXPECT_EQ(row["theta_witness"], "unknown");
  EXPECT_TRUE(row["theta_low_deg"].is_null());
  EXPECT_TRUE(row["target_x_mm"].is_null());
  EXPECT_EQ(row["repeat"], (*rows)[1].drive.axis[0].repeat);
}

TEST(StateRows, OfNoUnitAreText) { EXPECT_EQ(StateText({}), R"({"rows":[]})"); }

}  // namespace
}  // namespace focalfleet
