// The real focalfleetd, started, asked and ended.
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
#include <sstream>
#include <utility>
#include <vector>

#include "daemon/control/line_client.h"
#include "daemon/dds/status_reader.h"
#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/rng.h"
#include "protocol/wire/messages.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/taken_ports.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Process;
using test::ScratchFolder;
using test::WaitUntil;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kPatienceMs = 30'000;  // a hang ends here; nothing is timed

class FocalfleetdTest : public ::testing::Test {
 protected:
  FocalfleetdTest() {
    std::ofstream(scratch_ / "units.csv")
        << "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_"
           "gear,"
           "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,bus_id,node_id\n"
           "1,0,0,7.4,7.4,0,0,890,890,-190,190,0,190,0,1\n"
           "2,25.6,0,7.4,7.4,0,0,890,890,-190,190,0,190,1,1\n";
    Configure("[bus]\nport = \"simulated\"\n");
  }
  void Configure(const std::string& text) const {
    std::ofstream(scratch_ / "f.toml") << "[dds]\nenabled = false\n" << text;
  }
  [[nodiscard]] Process Start(const std::string& log = "log") const {
    return Process({FOCALFLEETD, "--config", scratch_ / "f.toml"}, scratch_ / log);
  }
  [[nodiscard]] int Run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> all{FOCALFLEETD};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return Process(all, scratch_ / "log").Wait();
  }
  [[nodiscard]] std::string Log(const std::string& log = "log") const {
    std::ifstream file(scratch_ / log);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  [[nodiscard]] Result<Json> Ask(const std::string& verb, const Json& args = Json::object()) const {
    FOCALFLEET_TRY_ASSIGN(LineClient client, LineClient::Connect(scratch_ / "control.sock"));
    return client.Call(verb, args);
  }
  [[nodiscard]] bool Answers() const {
    return WaitUntil([&] { return Ask("status").has_value(); }, kPatienceMs);
  }
  [[nodiscard]] bool Ready() const {
    return WaitUntil(
        [&] {
          const auto status = Ask("status");
          return status && (*status)["phases"]["ready"] == 2;
        },
        kPatienceMs);
  }

  const ScratchFolder scratch_;
};

TEST_F(FocalfleetdTest, EndsCleanlyOnSigterm) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
  EXPECT_NE(::access((scratch_ / "control.sock").c_str(), F_OK), 0) << "the socket is gone";
  EXPECT_THAT(Log(), HasSubstr("all is stored"));
}

/// Checks all that has to be true when a daemon has ended well, whatever it was doing.
class FocalfleetdEndTest : public FocalfleetdTest {
 protected:
  void ExpectEndOn(int signal, Process* daemon) const {
    daemon->Signal(signal);
    const auto code = daemon->WaitFor(kPatienceMs);
    ASSERT_TRUE(code) << "it does not end: " << Log();
    EXPECT_EQ(*code, 0) << Log();
    EXPECT_THAT(Log(), HasSubstr("all is stored"));
    EXPECT_NE(::access((scratch_ / "control.sock").c_str(), F_OK), 0) << "the socket is gone";
    EXPECT_NE(::access((scratch_ / "focalfleet.db-wal").c_str(), F_OK), 0)
        << "the store is one file";
    ExpectWholeStore();
  }
  /// The next daemon reads it, and finds the configuration ended.
  void ExpectWholeStore() const {
    auto next = Start("next");
    ASSERT_TRUE(Answers()) << Log("next");
    const auto history = Ask("history");
    ASSERT_TRUE(history) << history.error().text;
    EXPECT_EQ((*history)["configurations"][0]["state"], "failed") << history->dump(1);
  }
  [[nodiscard]] bool Reaches(const std::string& state) const {
    return WaitUntil(
        [&] {
          const auto status = Ask("status");
          return status && (*status)["configuration"]["state"] == state;
        },
        kPatienceMs);
  }
  void UseCamera() const {
    std::ofstream(scratch_ / "fiducials.csv")
        << "fiducial_id,x_mm,y_mm\n1,-40,0\n2,0,50\n3,60,10\n";
    Configure(
        "[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n"
        "[camera]\ndirectory = \"camera\"\nfiducials = \"fiducials.csv\"\npatience_ms = 3600000\n");
  }
  [[nodiscard]] bool AsksTheCamera() const {
    return WaitUntil(
        [&] { return ::access((scratch_ / "camera/request.json").c_str(), F_OK) == 0; },
        kPatienceMs);
  }
};

/// A fleet whose arms reach far into their neighbours', from one random configuration to another:
/// the planner gives up its units by ones and twos, for a minute.
class CrowdedFocalfleetdTest : public FocalfleetdEndTest {
 protected:
  static constexpr std::uint32_t kUnits = 300;
  CrowdedFocalfleetdTest()
      : layout_(Layout::Create(
                    MakeHexLayout(
                        {.count = kUnits, .pitch_mm = 14, .theta_arm_mm = 9, .phi_arm_mm = 10}),
                    {})
                    .value()) {
    std::vector<Unit> units;
    for (std::uint32_t n = 0; n < kUnits; ++n) units.push_back(layout_.unit({n}));
    std::ofstream(scratch_ / "units.csv") << WriteUnits(units);
  }
  [[nodiscard]] std::vector<Pose> Draw(std::uint64_t seed) const {
    return DrawConfiguration(layout_, drives_, std::vector<std::optional<Pose>>(kUnits),
                             Rng::Stream(seed, "configuration"))
        .value();
  }
  [[nodiscard]] std::string Targets(std::uint64_t seed) const {
    const std::vector<Pose> poses = Draw(seed);
    std::string targets = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const AxisAngles angles = AnglesOf(layout_.unit({n}), drives_[n], poses[n]);
      targets += std::to_string(layout_.unit({n}).id.value) + "," +
                 std::to_string(angles.theta_deg) + "," + std::to_string(angles.phi_deg) + "\n";
    }
    return targets;
  }
  /// Tells each unit that it stands there.
  void StandAt(const std::vector<Pose>& poses) const {
    auto client = LineClient::Connect(scratch_ / "control.sock");
    ASSERT_TRUE(client);
    for (std::uint32_t n = 0; n < kUnits; ++n)
      for (const Axis axis : kAxes) {
        const auto set = client->Call("params_set", {{"unit_id", layout_.unit({n}).id.value},
                                                     {"axis", Name(axis)},
                                                     {"parameter", Name(Parameter::kPosition)},
                                                     {"value", poses[n][Index(axis)]}});
        ASSERT_TRUE(set) << set.error().text;
      }
  }

  Layout layout_;
  std::vector<UnitDrive> drives_ = std::vector<UnitDrive>(kUnits);
};

TEST_F(CrowdedFocalfleetdTest, DoesNotWaitForAPlanThatTakesAMinute) {
  auto daemon = Start();
  ASSERT_TRUE(WaitUntil(
      [&] {
        const auto status = Ask("status");
        return status && (*status)["phases"]["ready"] == kUnits;
      },
      kPatienceMs))
      << Log();
  StandAt(Draw(1));
  const auto taken = Ask("apply", {{"targets_csv", Targets(2)}});
  ASSERT_TRUE(taken) << taken.error().text;
  ASSERT_TRUE(Reaches("planning")) << Log();
  ExpectEndOn(SIGTERM, &daemon);
  EXPECT_THAT(Log(), Not(HasSubstr("left behind"))) << "the planner heard that nobody waits";
}

TEST_F(FocalfleetdEndTest, DoesNotWaitForACamera) {
  UseCamera();
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_TRUE(
      Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,150\n"}, {"corrections", 1}}));
  ASSERT_TRUE(AsksTheCamera()) << Log();
  ExpectEndOn(SIGINT, &daemon);
  EXPECT_THAT(Log(), Not(HasSubstr("left behind")));
}

// As on a file system that is gone: whoever opens this FIFO waits for ever.
TEST_F(FocalfleetdEndTest, DoesNotWaitForACameraFolderThatHangs) {
  UseCamera();
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_EQ(::mkfifo((scratch_ / "camera/request.json").c_str(), 0600), 0);
  ASSERT_TRUE(
      Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,150\n"}, {"corrections", 1}}));
  ASSERT_TRUE(WaitUntil(
      [&] {
        const auto status = Ask("status");
        return status && (*status)["configuration"]["arrived"] == 1;
      },
      kPatienceMs))
      << Log();
  ExpectEndOn(SIGTERM, &daemon);
}

TEST_F(FocalfleetdEndTest, TellsThoseWhoWaitAndGivesTheBusesBack) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  auto client = LineClient::Connect(scratch_ / "control.sock");
  ASSERT_TRUE(client);
  bool ended = false;
  const auto done = client->Call(
      "apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,180,90\n"}, {"wait", true}},
      {.silence_max = Seconds(60), .on_progress = [&](const Json&) {
         if (!std::exchange(ended, true)) daemon.Signal(SIGTERM);
       }});
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().text, HasSubstr("the daemon ends"));
  EXPECT_EQ(daemon.WaitFor(kPatienceMs), 0) << Log();
  ExpectWholeStore();
}

TEST_F(FocalfleetdTest, GoesOnAfterSighup) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  daemon.Signal(SIGHUP);
  EXPECT_TRUE(Answers());
  EXPECT_TRUE(daemon.running());
}

TEST_F(FocalfleetdTest, MovesAUnitAndSaysSo) {
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

TEST_F(FocalfleetdTest, TellsTheTimeSoFarWhileAConfigurationMoves) {
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

TEST_F(FocalfleetdTest, TellsTheClientAllBadRowsAndItsLogTheFirst) {
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

// The camera may be another user: what it puts into its folder is neither followed nor waited for.
TEST_F(FocalfleetdTest, EndsWhateverLiesInTheCamerasFolder) {
  std::ofstream(scratch_ / "fiducials.csv") << "fiducial_id,x_mm,y_mm\n1,-40,0\n2,40,9\n3,0,40\n";
  Configure(
      "[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n[camera]\ndirectory = \"camera\"\n"
      "fiducials = \"fiducials.csv\"\npatience_ms = 600000\n");
  std::ofstream(scratch_ / "secret") << "secret";
  ASSERT_EQ(mkdir((scratch_ / "camera").c_str(), 0700), 0);
  for (const char* name : {"camera/old.csv", "camera/request.json"})
    ASSERT_EQ(mkfifo((scratch_ / name).c_str(), 0600), 0);
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_EQ(mkfifo((scratch_ / "camera/new.fits").c_str(), 0600), 0);
  ASSERT_EQ(symlink("../secret", (scratch_ / "camera/new.csv").c_str()), 0);
  ASSERT_TRUE(
      Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,150\n"}, {"corrections", 1}}));
  EXPECT_TRUE(WaitUntil(
      [&] {
        return Log().find("new.csv: a symbolic link, no file") != std::string::npos &&
               Log().find("new.fits: a named pipe, no file") != std::string::npos;
      },
      kPatienceMs))
      << Log();
  EXPECT_EQ(::access((scratch_ / "camera/refused/new.fits.reason").c_str(), F_OK), 0);
  // A request into a link would be written now, and the thread would wait for this pipe.
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
  std::ifstream secret(scratch_ / "secret");
  std::string text;
  secret >> text;
  EXPECT_EQ(text, "secret");
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

TEST_F(FocalfleetdTest, SaysWhatIsWrongWithItsFilesAndTouchesNothing) {
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
  EXPECT_THAT(Log("fits"), HasSubstr("units.fits: this is a FITS file"));
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

TEST_F(FocalfleetdTest, IdleConnectionsKeepNobodyOut) {
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

TEST_F(FocalfleetdTest, SaysThatTheEnvironmentDoesNotDecideWhereStatusGoes) {
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
