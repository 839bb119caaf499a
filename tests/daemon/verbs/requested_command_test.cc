#include "daemon/verbs/requested_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::SmallFleet;
using ::testing::HasSubstr;

Result<Command> Try(const SmallFleet& fleet, const std::string& verb, const Json& args) {
  return CommandOf({.id = 1, .verb = verb, .args = args}, fleet.View());
}
std::string ErrorOf(const SmallFleet& fleet, const std::string& verb, const Json& args) {
  const auto command = Try(fleet, verb, args);
  EXPECT_FALSE(command);
  return command ? "" : command.error().text;
}

TEST(RequestedCommand, MakesCommandsOfVerbs) {
  const SmallFleet fleet;
  const auto stop = Try(fleet, "stop", Json::object());
  ASSERT_TRUE(stop);
  EXPECT_FALSE(std::get<StopCommand>(stop->what).unit);
  EXPECT_EQ(std::get<StopCommand>(Try(fleet, "stop", {{"unit_id", 2}})->what).unit,
            PositionerIndex{1});
  const auto disable = Try(fleet, "disable", {{"unit_ids", {1, 3}}, {"reason", "stalls"}});
  ASSERT_TRUE(disable);
  EXPECT_EQ(std::get<EnableCommand>(disable->what).units.size(), 2u);
  EXPECT_FALSE(std::get<EnableCommand>(disable->what).enabled);
  const auto write = Try(
      fleet, "params_set",
      {{"unit_id", 1}, {"axis", "phi"}, {"parameter", Name(Parameter::kRepeat)}, {"value", 54}});
  ASSERT_TRUE(write) << write.error().text;
  EXPECT_EQ(std::get<WriteParameterCommand>(write->what).axis, Axis::kPhi);
  EXPECT_EQ(std::get<WriteParameterCommand>(write->what).value, 54);
  EXPECT_TRUE(Try(fleet, "adopt", {{"unit_id", 1}}));
  EXPECT_TRUE(Try(fleet, "enable", {{"unit_ids", {1}}}));
  EXPECT_TRUE(Try(fleet, "home", {{"unit_ids", {1}}}));
}

TEST(RequestedCommand, TakesEachNamedUnitOnceAndNoMoreThanTheFleetHas) {
  const SmallFleet fleet;
  const auto twice = Try(fleet, "disable", {{"unit_ids", {3, 1, 3}}, {"reason", "stalls"}});
  ASSERT_TRUE(twice) << twice.error().text;
  EXPECT_EQ(std::get<EnableCommand>(twice->what).units, (std::vector<PositionerIndex>{{2}, {0}}));
  EXPECT_EQ(std::get<HomeCommand>(Try(fleet, "home", {{"unit_ids", {2, 2}}})->what).units.size(),
            1u);
  const std::vector<std::uint32_t> many(4, 1);
  EXPECT_THAT(ErrorOf(fleet, "home", {{"unit_ids", many}}),
              HasSubstr("4 units are named, and there are 3"));
}

TEST(RequestedCommand, TextsThatAreKeptAreBounded) {
  const SmallFleet fleet;
  const std::string text(256, 'x');
  EXPECT_THAT(ErrorOf(fleet, "disable", {{"unit_ids", {1}}, {"reason", text}}),
              HasSubstr("argument 'reason' has 256 bytes, at most 255 are taken"));
  const std::string targets =
      "unit_id,theta_deg,phi_deg\n2,10,90\n" + std::string(1000, '#') + "\n";
  EXPECT_THAT(ErrorOf(fleet, "apply", {{"source", text}, {"targets_csv", targets}}),
              HasSubstr("argument 'source' has 256 bytes"));
  EXPECT_TRUE(Try(fleet, "apply", {{"source", "t"}, {"targets_csv", targets}}))
      << "a file is as long as a line may be";
  EXPECT_THAT(ErrorOf(fleet, "params_set", {{"unit_id", 1}, {"axis", text}}),
              HasSubstr("argument 'axis'"));
}

TEST(RequestedCommand, ATableOfTooManyLinesIsNotRead) {
  const SmallFleet fleet;
  EXPECT_THAT(ErrorOf(fleet, "apply", {{"targets_csv", std::string(70'000, '\n')}}),
              HasSubstr("targets: 70000 lines are more than 65536"));
}

TEST(RequestedCommand, ResolvesTargets) {
  const SmallFleet fleet;
  const auto apply = Try(fleet, "apply",
                         {{"source", "t.csv"},
                          {"targets_csv", "unit_id,theta_deg,phi_deg\n2,10,90\n"},
                          {"fixed", true}});
  ASSERT_TRUE(apply) << apply.error().text;
  const auto& command = std::get<ApplyCommand>(apply->what);
  EXPECT_TRUE(command.fixed);
  ASSERT_EQ(command.targets.size(), 3u);
  EXPECT_FALSE(command.targets[0]);
  EXPECT_TRUE(command.targets[1]);
}

TEST(RequestedCommand, RetargetTakesAPlaceOrTwoAngles) {
  const SmallFleet fleet;
  const auto place = Try(fleet, "retarget", {{"unit_id", 2}, {"x_mm", 30.5}, {"y_mm", 4}});
  ASSERT_TRUE(place) << place.error().text;
  EXPECT_EQ(std::get<RetargetCommand>(place->what).unit, PositionerIndex{1});
  const auto angles = Try(fleet, "retarget", {{"unit_id", 2}, {"theta_deg", 10}, {"phi_deg", 90}});
  ASSERT_TRUE(angles) << angles.error().text;
  const Pose pose = std::get<RetargetCommand>(angles->what).target;
  const auto applied = Try(fleet, "apply",
                           {{"source", "t.csv"},
                            {"targets_csv", "unit_id,theta_deg,phi_deg\n2,10,90\n"},
                            {"fixed", true}});
  EXPECT_EQ(pose, *std::get<ApplyCommand>(applied->what).targets[1]);
  EXPECT_THAT(ErrorOf(fleet, "retarget", {{"unit_id", 2}, {"x_mm", 30.5}}), HasSubstr("y_mm"));
  EXPECT_THAT(ErrorOf(fleet, "retarget", {{"unit_id", 9}, {"x_mm", 0}, {"y_mm", 0}}),
              HasSubstr("no unit 9"));
  const std::string far = ErrorOf(fleet, "retarget", {{"unit_id", 2}, {"x_mm", 99}, {"y_mm", 0}});
  EXPECT_EQ(far.find("unit 2: x_mm"), 0u) << far;
  EXPECT_THAT(far, HasSubstr("out of patrol"));
}

TEST(RequestedCommand, NamesTheFault) {
  const SmallFleet fleet;
  EXPECT_THAT(ErrorOf(fleet, "dance", Json::object()), HasSubstr("no verb 'dance'"));
  EXPECT_THAT(ErrorOf(fleet, "adopt", {{"unit_id", 99}}), HasSubstr("no unit 99"));
  EXPECT_THAT(ErrorOf(fleet, "adopt", {{"unit_id", 5'000'000'000}}),
              HasSubstr("no unit 5000000000"));
  EXPECT_THAT(ErrorOf(fleet, "adopt", {{"unit_id", "1"}}), HasSubstr("unit_id"));
  EXPECT_THAT(ErrorOf(fleet, "disable", {{"unit_ids", {1}}}), HasSubstr("reason"));
  EXPECT_THAT(ErrorOf(fleet, "disable", {{"unit_ids", {1}}, {"reason", ""}}), HasSubstr("why"));
  EXPECT_THAT(ErrorOf(fleet, "enable", {{"unit_ids", Json::array()}}), HasSubstr("no unit named"));
  EXPECT_THAT(ErrorOf(fleet, "home", {{"not_known", true}}), HasSubstr("knows where it stands"));
  EXPECT_THAT(
      ErrorOf(fleet, "apply",
              {{"source", "t.csv"}, {"targets_csv", "unit_id,theta_deg,phi_deg\n77,10,90\n"}}),
      HasSubstr("t.csv:2"));
  EXPECT_THAT(ErrorOf(fleet, "params_set",
                      {{"unit_id", 1}, {"axis", "psi"}, {"parameter", "repeat"}, {"value", 1}}),
              HasSubstr("no axis 'psi'"));
  EXPECT_THAT(ErrorOf(fleet, "params_set",
                      {{"unit_id", 1}, {"axis", "phi"}, {"parameter", "colour"}, {"value", 1}}),
              HasSubstr("no parameter 'colour'"));
}

TEST(RequestedCommand, RefusesValuesThatNoUnitTakes) {
  const SmallFleet fleet;
  const auto error = [&](const char* parameter, std::int64_t value) {
    return ErrorOf(fleet, "params_set",
                   {{"unit_id", 1}, {"axis", "phi"}, {"parameter", parameter}, {"value", value}});
  };
  EXPECT_EQ(error("repeat", 0), "repeat must be 1..255, not 0");
  EXPECT_EQ(error("repeat", 256), "repeat must be 1..255, not 256");
  EXPECT_EQ(error("subdivision", 95), "subdivision must be 6..1536 in steps of 6, not 95");
  EXPECT_EQ(error("mode", 9), "mode must be 0..2, not 9");
  EXPECT_EQ(error("counter1", -5), "counter1 must be 50..20000, not -5");
  EXPECT_EQ(error("host_timeout_ms", 99), "host_timeout_ms must be 100..3600000, not 99");
  EXPECT_EQ(error("position", 8'388'608), "position must be -8388607..8388607, not 8388608");
  EXPECT_EQ(error("position", 5'000'000'000), "position must be -8388607..8388607, not 5000000000");
}

}  // namespace
}  // namespace focalfleet
