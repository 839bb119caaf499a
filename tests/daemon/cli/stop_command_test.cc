// focalfleet stop through the daemon; direct_stop_test.cc tests the way without a daemon.
#include <gmock/gmock.h>

#include "tests/daemon/cli/daemon_commands.h"

namespace focalfleet {
namespace {

using test::DaemonCommands;
using test::Focalfleet;
using test::StatusAnswer;
using ::testing::HasSubstr;

TEST_F(DaemonCommands, StopNamesAUnitOrNone) {
  const auto all = Ask({"stop"}, {{"stop", {}}, {"status", {.result = StatusAnswer()}}});
  EXPECT_EQ(all.exit, 0) << all.err;
  EXPECT_EQ(requests_.at(0).args, Json::object());
  const auto one =
      Ask({"stop", "17"}, {{"stop", {}}, {"unit", {.result = Json{{"phase", "ready"}}}}});
  EXPECT_EQ(one.exit, 0) << one.err;
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 17}}));
}

TEST_F(DaemonCommands, AStopIsDoneWhenUnitsStand) {
  Json moves = StatusAnswer();
  moves["phases"] = {{"ready", 1}, {"settling", 1}};
  const auto all = Ask({"stop", "--within-s", "0"}, {{"stop", {}}, {"status", {.result = moves}}});
  EXPECT_EQ(all.exit, 3);
  EXPECT_THAT(all.err, HasSubstr("1 unit did not confirm"));
  const auto one = Ask({"stop", "17", "--within-s", "0", "--json"},
                       {{"stop", {}}, {"unit", {.result = Json{{"phase", "moving"}}}}});
  EXPECT_EQ(one.exit, 3);
  EXPECT_EQ(Json::parse(one.out, nullptr, false)["not_standing"], 1);
  moves["phases"] = {{"ready", 1}, {"silent", 2}, {"identifying", 1}, {"absent", 1}};
  const auto silent =
      Ask({"stop", "--within-s", "0"}, {{"stop", {}}, {"status", {.result = moves}}});
  EXPECT_EQ(silent.exit, 3);
  EXPECT_THAT(silent.err, HasSubstr("3 units do not answer, so whether they stand is not known"));
  const auto absent = Ask({"stop", "17", "--within-s", "0", "--json"},
                          {{"stop", {}}, {"unit", {.result = Json{{"phase", "absent"}}}}});
  EXPECT_EQ(absent.exit, 3);
  EXPECT_EQ(Json::parse(absent.out, nullptr, false)["not_known"], 1);
  EXPECT_EQ(Ask({"stop"}, {{"stop", {}}}).exit, 5) << "whether they stand is not known";
}

// A daemon whose places are all taken accepts a stop and refuses other requests.
TEST_F(DaemonCommands, AStopAsksAgainWhereTheDaemonHasNoPlaceForAQuestion) {
  const auto all = Ask({"stop", "--within-s", "600"},
                       {{"stop", {}}, {"status", {.full_first = 2, .result = StatusAnswer()}}});
  EXPECT_EQ(all.exit, 0) << all.err;
  EXPECT_EQ(requests_.size(), 4u);
  const auto never =
      Ask({"stop", "--within-s", "0"},
          {{"stop", {}}, {"status", {.full_first = 1000, .result = StatusAnswer()}}});
  EXPECT_EQ(never.exit, 5);
  EXPECT_THAT(never.err, HasSubstr("whether units stand is not known: too many clients"));
}

TEST_F(DaemonCommands, StopPointsToTheDirectWayWhereNoDaemonAnswers) {
  const auto result = Focalfleet({"stop", "--socket", scratch_ / "nobody"});
  EXPECT_EQ(result.exit, 4);
  EXPECT_THAT(result.err, HasSubstr("stop --direct"));
}

}  // namespace
}  // namespace focalfleet
