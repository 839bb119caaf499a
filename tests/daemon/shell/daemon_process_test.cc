// The real focalfleetd, started, asked and ended.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "daemon/control/line_client.h"
#include "tests/daemon/control/scratch.h"
#include "tests/support/process.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::Process;
using testing::WaitUntil;

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

  const Scratch scratch_;
};

TEST_F(FocalfleetdTest, EndsCleanlyOnSigterm) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
  EXPECT_NE(::access((scratch_ / "control.sock").c_str(), F_OK), 0) << "the socket is gone";
  EXPECT_THAT(Log(), HasSubstr("all is stored"));
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

TEST_F(FocalfleetdTest, StopAlwaysWorks) {
  auto daemon = Start();
  ASSERT_TRUE(Answers()) << Log();
  EXPECT_TRUE(Ask("stop"));
  EXPECT_TRUE(Ask("stop", {{"unit_id", 2}}));
  EXPECT_FALSE(Ask("stop", {{"unit_id", 3}}));
}

}  // namespace
}  // namespace focalfleet
