// The command doctor, on the machine of the test and with scripted daemons.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "tests/daemon/cli/daemon_commands.h"

namespace focalfleet {
namespace {

using test::DaemonCommands;
using test::FakeAnswer;
using test::Focalfleet;
using test::ProgramResult;
using test::StatusAnswer;
using ::testing::HasSubstr;
using ::testing::Not;

class Doctor : public DaemonCommands {
 protected:
  Doctor() {
    std::ofstream(scratch_ / "units.csv")
        << "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,"
           "theta_gear,phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,bus_id,"
           "node_id\n1,0,0,7.4,7.4,0,0,890,890,-190,190,0,190,0,1\n";
    std::ofstream(scratch_ / "f.toml") << "[bus]\nport = \"simulated\"\n[dds]\nenabled = false\n";
  }
  static std::string ResultOf(const Json& answer, const std::string& check) {
    for (const Json& entry : answer["checks"])
      if (entry["check"] == check) return entry["result"];
    return "absent";
  }
};

TEST_F(Doctor, WithoutADaemonFailsAndSaysHowToStartIt) {
  const ProgramResult result = Focalfleet({"doctor", "--config", scratch_ / "f.toml"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.out, HasSubstr("fail  daemon: no daemon at " + (scratch_ / "control.sock")));
  EXPECT_THAT(result.out, HasSubstr("      do: systemctl start focalfleetd"));
  EXPECT_THAT(result.out, HasSubstr("ok    configuration: "));
  EXPECT_EQ(result.err, "");
}

TEST_F(Doctor, ListsEachCheckAsJson) {
  Json status = StatusAnswer();
  status["buses"].erase(1);
  const ProgramResult result =
      Ask({"doctor", "--json", "--config", scratch_ / "f.toml"}, {{"status", {.result = status}}});
  const Json answer = Json::parse(result.out, nullptr, false);
  ASSERT_TRUE(answer.is_object()) << result.out << result.err;
  for (const Json& check : answer["checks"]) {
    EXPECT_EQ(check.size(), 4u) << check;
    EXPECT_EQ(check["result"] == "ok", check["do"] == "") << check;
  }
  EXPECT_EQ(ResultOf(answer, "daemon"), "ok") << answer.dump(1);
  EXPECT_EQ(ResultOf(answer, "configuration"), "ok") << answer.dump(1);
  EXPECT_EQ(ResultOf(answer, "store"), "warn") << "there is no store yet";
  EXPECT_EQ(answer["result"], result.exit == 1 ? "fail" : "warn");
  EXPECT_NE(result.exit, 0);
}

TEST_F(Doctor, ABadConfigurationIsNamedWithItsLine) {
  std::ofstream(scratch_ / "f.toml") << "[buss]\nport = \"simulated\"\n";
  const ProgramResult result = Focalfleet({"doctor", "--config", scratch_ / "f.toml"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.out, HasSubstr("fail  configuration: "));
  EXPECT_THAT(result.out, HasSubstr("f.toml:1: unknown key 'buss'"));
  EXPECT_THAT(result.out, HasSubstr("open files"));
}

TEST_F(DaemonCommands, VersionShowsTheDaemonsAndWarnsWhereTheyDiffer) {
  Json status = StatusAnswer();
  const std::string own = Focalfleet({"--version", "--socket", "/nowhere"}).out;
  ASSERT_THAT(own, HasSubstr("focalfleet "));
  EXPECT_THAT(own, Not(HasSubstr("focalfleetd")));
  status["version"] = own.substr(11, own.size() - 12);
  ProgramResult same = Ask({"--version"}, {{"status", {.result = status}}});
  EXPECT_EQ(same.exit, 0);
  EXPECT_EQ(same.out, own + "focalfleetd " + status["version"].get<std::string>() + "\n");
  EXPECT_EQ(same.err, "");
  status["version"] = "0.0.7";
  ProgramResult other = Ask({"--version"}, {{"status", {.result = status}}});
  EXPECT_EQ(other.exit, 0);
  EXPECT_THAT(other.out, HasSubstr("focalfleetd 0.0.7\n"));
  EXPECT_THAT(other.err, HasSubstr("warning: the daemon is version 0.0.7"));
}

TEST_F(DaemonCommands, StatusNamesBothVersionsWhereTheyDiffer) {
  Json status = StatusAnswer();
  status["version"] = "0.0.7";
  const ProgramResult text = Ask({"status"}, {{"status", {.result = status}}});
  EXPECT_THAT(text.out, HasSubstr("the daemon is version 0.0.7, this command line "));
  const ProgramResult json = Ask({"status", "--json"}, {{"status", {.result = status}}});
  const Json answer = Json::parse(json.out, nullptr, false);
  EXPECT_EQ(answer["version"], "0.0.7");
  status["version"] = answer["client_version"];
  const ProgramResult same = Ask({"status"}, {{"status", {.result = status}}});
  EXPECT_THAT(same.out, Not(HasSubstr("this command line")));
}

}  // namespace
}  // namespace focalfleet
