// The real focalfleetd, started and asked.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "daemon/control/line_client.h"
#include "daemon/dds/status_reader.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/taken_ports.h"
#include "tests/daemon/process/focalfleetd_fixture.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::FocalfleetdTest;
using test::kPatienceMs;
using test::Process;
using test::ScratchFolder;
using test::WaitUntil;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(FocalfleetdTest, GoesOnAfterSighup) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  daemon.Signal(SIGHUP);
  EXPECT_TRUE(Answers());
  EXPECT_TRUE(daemon.running());
}

TEST_F(FocalfleetdTest, MovesAUnitAndReportsIt) {
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  auto client = LineClient::Connect(scratch_ / "control.sock");
  ASSERT_TRUE(client);
  int progress = 0;
  const auto done =
      client->Call("apply",
                   {{"source", "t.csv"},
                    {"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,150\n"},
                    {"wait", true}},
                   {.silence_max = Seconds(60), .on_progress = [&](const Json&) { ++progress; }});
  ASSERT_TRUE(done) << done.error().text << "\n" << Log();
  EXPECT_EQ((*done)["state"], "done");
  EXPECT_EQ((*done)["arrived"], 1) << done->dump(1);
  EXPECT_GT(progress, 0);
  const auto unit = Ask("unit", {{"unit_id", 1}});
  ASSERT_TRUE(unit);
  EXPECT_EQ((*unit)["theta"]["witness"], "reported");
  EXPECT_NEAR((*unit)["theta"]["low_deg"].get<double>(), 20, 0.01);
  const auto history = Ask("history", {{"unit_id", 1}});
  ASSERT_TRUE(history) << history.error().text;
  EXPECT_EQ((*history)["moves"][0]["end"], "arrived") << history->dump(1);
  const auto refused = Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,999\n"}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
}

TEST_F(FocalfleetdTest, ReportsTheTimeSoFarWhileAConfigurationMoves) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_TRUE(Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,180,90\n"}}));
  EXPECT_TRUE(WaitUntil(
      [&] {
        const auto status = Ask("status");
        return status && (*status)["configuration"]["state"] == "moving" &&
               (*status)["configuration"]["makespan_s"] > 0;
      },
      kPatienceMs));
}

TEST_F(FocalfleetdTest, ReportsAllBadRowsToTheClientAndTheFirstToItsLog) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  const auto refused =
      Ask("apply", {{"source", "t.csv"},
                    {"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,999\n2,20,999\n3,0,0\n"}});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("t.csv:2: unit 1: phi_deg 999"));
  EXPECT_THAT(refused.error().text, HasSubstr("\n  t.csv:3: unit 2: phi_deg 999"));
  EXPECT_THAT(refused.error().text, HasSubstr("\n  t.csv:4: unit 3: unknown unit"));
  EXPECT_TRUE(
      WaitUntil([&] { return Log().find("(and 2 more)") != std::string::npos; }, kPatienceMs))
      << Log();
  EXPECT_THAT(Log(), HasSubstr("apply refused: t.csv:2: unit 1: phi_deg 999"));
  EXPECT_THAT(Log(), Not(HasSubstr("t.csv:4")));
}

TEST_F(FocalfleetdTest, ASecondOneOnTheSameStoreIsRefused) {
  const auto first = Start();
  ASSERT_TRUE(Answers()) << Log();
  EXPECT_EQ(Start("second").Wait(), 1);
  EXPECT_THAT(Log("second"), HasSubstr("focalfleet.db"));
  EXPECT_TRUE(Answers()) << "the first one is unharmed";
}

TEST_F(FocalfleetdTest, ASecondOneOnTheSameSocketIsRefused) {
  const auto first = Start();
  ASSERT_TRUE(Answers()) << Log();
  Configure("[bus]\nport = \"simulated\"\n[store]\npath = \"other.db\"\n");
  EXPECT_EQ(Start("second").Wait(), 1);
  EXPECT_THAT(Log("second"), HasSubstr("in use"));
  EXPECT_TRUE(Answers()) << "the first one is unharmed";
}

TEST_F(FocalfleetdTest, StartsAgainAfterItWasKilled) {
  {
    auto first = Start();
    ASSERT_TRUE(Answers()) << Log();
    first.Signal(SIGKILL);
    EXPECT_EQ(first.Wait(), 128 + SIGKILL);
  }
  auto second = Start();
  EXPECT_TRUE(Answers()) << Log();
  second.Signal(SIGINT);
  EXPECT_EQ(second.Wait(), 0);
}

TEST_F(FocalfleetdTest, NamesAMissingInterface) {
  Configure("[bus]\nport = \"socketcan\"\ninterfaces = [\"nocan0\", \"nocan1\"]\n");
  EXPECT_EQ(Start().Wait(), 1);
  EXPECT_THAT(Log(), HasSubstr("f.toml:5: none of bus.interfaces is there"));
  EXPECT_THAT(Log(), HasSubstr("nocan0"));
  Configure("[bus]\nport = \"socketcan\"\ninterfaces = [\"nocan0\"]\n");
  EXPECT_EQ(Start("count").Wait(), 1);
  EXPECT_THAT(Log("count"), HasSubstr("f.toml:5: bus.interfaces names 1 interfaces"));
}

TEST_F(FocalfleetdTest, MakesNoFolderForItsLog) {
  Configure("[bus]\nport = \"simulated\"\n[log]\nfile = \"no/such/log\"\n");
  EXPECT_EQ(Start().Wait(), 1);
  EXPECT_THAT(Log(), HasSubstr("f.toml:6: log.file: there is no folder "));
  EXPECT_NE(::access((scratch_ / "no").c_str(), F_OK), 0);
  Configure("[bus]\nport = \"simulated\"\n[log]\nfile = \".\"\n");
  EXPECT_EQ(Start("folder").Wait(), 1);
  EXPECT_THAT(Log("folder"), HasSubstr("f.toml:6: log.file: "));
}

TEST_F(FocalfleetdTest, WaitsForBusesThatAreNotThereYet) {
  Configure("[bus]\nport = \"unix\"\nunix_directory = \".\"\n");
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  const auto status = Ask("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["buses"][0]["link"], "down");
  EXPECT_THAT((*status)["buses"][0]["trouble"].get<std::string>(), HasSubstr("cannot connect"));
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
}

TEST_F(FocalfleetdTest, ReportsFaultsOfItsFilesAndTouchesNothing) {
  Configure("[bus]\nport = \"simulated\"\n[fleet]\nunits = \"none.csv\"\n");
  EXPECT_EQ(Start("a").Wait(), 1);
  EXPECT_THAT(Log("a"), HasSubstr("none.csv"));
  ASSERT_EQ(mkfifo((scratch_ / "pipe.csv").c_str(), 0600), 0);
  Configure("[bus]\nport = \"simulated\"\n[fleet]\nunits = \"pipe.csv\"\n");
  EXPECT_EQ(Start("pipe").Wait(), 1);
  EXPECT_THAT(Log("pipe"), HasSubstr("pipe.csv: a named pipe"));
  std::ofstream(scratch_ / "units.fits") << "SIMPLE  =                    T";
  Configure("[bus]\nport = \"simulated\"\n[fleet]\nunits = \"units.fits\"\n");
  EXPECT_EQ(Start("fits").Wait(), 1);
  EXPECT_THAT(Log("fits"), HasSubstr("units.fits: unit 0: its header does not end"));
  Configure("[buss]\n");
  EXPECT_EQ(Start("b").Wait(), 1);
  EXPECT_THAT(Log("b"), HasSubstr("f.toml:3: unknown key 'buss'"));
  EXPECT_NE(::access((scratch_ / "focalfleet.db").c_str(), F_OK), 0);
}

TEST_F(FocalfleetdTest, CheckShowsTheEffectiveConfigurationAndStartsNothing) {
  EXPECT_EQ(Run({"--config", scratch_ / "f.toml", "--check"}), 0);
  EXPECT_THAT(Log(), HasSubstr("2 units on 2 buses"));
  EXPECT_THAT(Log(), HasSubstr("reply_wait_ms = "));
  EXPECT_NE(::access((scratch_ / "focalfleet.db").c_str(), F_OK), 0);
}

TEST_F(FocalfleetdTest, WrongUsageIsTwoAndHelpIsZero) {
  EXPECT_EQ(Run({}), 2);
  EXPECT_EQ(Run({"--no-such-option"}), 2);
  EXPECT_EQ(Run({"--help"}), 0);
  EXPECT_EQ(Run({"--version"}), 0);
  EXPECT_THAT(Log(), HasSubstr("Exit codes"));
}

TEST_F(FocalfleetdTest, IdleConnectionsKeepNoClientOut) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  std::vector<LineClient> idle;
  for (int i = 0; i < 200; ++i) {
    auto client = LineClient::Connect(scratch_ / "control.sock");
    ASSERT_TRUE(client) << client.error().text;
    idle.push_back(std::move(*client));
  }
  const auto stopped = Ask("stop");
  EXPECT_TRUE(stopped) << stopped.error().text;
  EXPECT_TRUE(Ask("status"));
}

TEST_F(FocalfleetdTest, RunsWithoutDdsAndPublishesEverythingWhenItIsThere) {
  const std::uint32_t domain = test::OwnDomain();
  std::ofstream(scratch_ / "f.toml")
      << "[dds]\ndomain = " << domain << "\n[bus]\nport = \"simulated\"\n";
  auto taken = std::make_unique<test::TakenPorts>(domain);
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  auto status = Ask("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["dds"]["enabled"], true);
  EXPECT_THAT((*status)["dds"]["trouble"].get<std::string>(), HasSubstr("status: DDS: cannot"));
  EXPECT_THAT(Log(), HasSubstr("no DDS for status, the rest goes on and it is tried again"));
  ASSERT_TRUE(WaitUntil(
      [&] {
        const auto history = Ask("history");
        return history && history->dump().find("no DDS for status") != std::string::npos;
      },
      kPatienceMs))
      << "an alarm, and stored";
  taken.reset();
  auto reader = StatusReader::Create({.dds = {.domain = domain, .config_xml = {}}});
  ASSERT_TRUE(reader) << reader.error().text;
  std::set<std::uint32_t> units;
  std::set<std::string> alarms;
  StatusUpdate update;
  const auto all_reported = [&] {
    EXPECT_TRUE((*reader)->Wait(std::chrono::milliseconds(10)));
    EXPECT_TRUE((*reader)->Take(&update));
    for (const UnitStatusValue& unit : update.units) units.insert(unit.unit.value);
    for (const AlarmValue& alarm : update.alarms) alarms.insert(alarm.row.text);
    return units.size() == 2 && alarms.contains("DDS is there again for status");
  };
  EXPECT_TRUE(WaitUntil(all_reported, kPatienceMs)) << "units that rest since before, too";
  EXPECT_TRUE(std::ranges::any_of(alarms, [](const std::string& text) {
    return text.find("no DDS for status") != std::string::npos;
  })) << "the alarms from before, too";
  status = Ask("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["dds"]["trouble"], "");
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.WaitFor(kPatienceMs), 0) << Log();
}

TEST_F(FocalfleetdTest, EndsWhileItStillTriesToJoinDds) {
  const std::uint32_t domain = test::OwnDomain();
  std::ofstream(scratch_ / "f.toml")
      << "[dds]\ndomain = " << domain << "\n[bus]\nport = \"simulated\"\n";
  const test::TakenPorts taken(domain);
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.WaitFor(kPatienceMs), 0) << Log();
}

TEST_F(FocalfleetdTest, WarnsThatTheEnvironmentDoesNotDecideWhereStatusGoes) {
  std::ofstream(scratch_ / "f.toml")
      << "[dds]\ndomain = " << test::OwnDomain() << "\n[bus]\nport = \"simulated\"\n";
  ::setenv("CYCLONEDDS_URI", "<Nonsense/>", 1);
  auto daemon = Start();
  ::unsetenv("CYCLONEDDS_URI");
  ASSERT_TRUE(Answers()) << Log();
  EXPECT_THAT(Log(), HasSubstr("CYCLONEDDS_URI is set and is not used"));
  const auto status = Ask("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["dds"]["trouble"], "");
}

TEST_F(FocalfleetdTest, ALineOfItsLogIsItsOwn) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  EXPECT_FALSE(Ask("x\nforged\x1b[2J"));
  EXPECT_THAT(Log(), HasSubstr("x\\nforged\\x1b[2J refused"));
  EXPECT_THAT(Log(), Not(HasSubstr("\x1b")));
}

TEST_F(FocalfleetdTest, StopAlwaysWorks) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  EXPECT_TRUE(Ask("stop"));
  EXPECT_TRUE(Ask("stop", {{"unit_id", 2}}));
  EXPECT_FALSE(Ask("stop", {{"unit_id", 3}}));
}

}  // namespace
}  // namespace focalfleet
