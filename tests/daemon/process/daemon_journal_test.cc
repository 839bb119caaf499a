// The journal of the real focalfleetd, replayed by it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>

#include "tests/daemon/process/focalfleetd_fixture.h"

namespace focalfleet {
namespace {

using test::kPatienceMs;
using test::WaitUntil;
using ::testing::HasSubstr;

class DaemonJournal : public test::FocalfleetdTest {
 protected:
  DaemonJournal() { Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n"); }

  /// A configuration is carried out.
  void MoveUnits() {
    auto client = LineClient::Connect(scratch_ / "control.sock");
    ASSERT_TRUE(client);
    const auto done = client->Call("apply",
                                   {{"source", "t.csv"},
                                    {"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,150\n"},
                                    {"wait", true}},
                                   {.silence_max = Seconds(60)});
    ASSERT_TRUE(done) << done.error().text << "\n" << Log();
    ASSERT_EQ((*done)["arrived"], 1) << done->dump(1);
  }
  int Replay(const std::string& log) const {
    return test::Process({FOCALFLEETD, "--replay", folder_}, scratch_ / log).Wait();
  }
  bool HasAlarm(const std::string& name) const {
    const auto alarms = Ask("alarms");
    return alarms && alarms->dump().find("\"" + name + "\"") != std::string::npos;
  }

  const std::string folder_ = scratch_ / "focalfleet.db.journal";
};

TEST_F(DaemonJournal, EachStepOfALifeIsDecidedTheSameInItsReplay) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  MoveUnits();
  daemon.Signal(SIGTERM);
  ASSERT_EQ(daemon.Wait(), 0);
  EXPECT_EQ(Replay("replay"), 0) << Log("replay");
  EXPECT_THAT(Log("replay"), HasSubstr("2 units"));
  EXPECT_THAT(Log("replay"), HasSubstr("all decided as recorded"));
  EXPECT_THAT(Log("replay"), HasSubstr("the journal is whole"));
}

TEST_F(DaemonJournal, ALifeThatWasCutShortIsReplayedToItsEnd) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  MoveUnits();
  test::Pause(1000);  // the journal is written four times a second
  daemon.Signal(SIGKILL);
  daemon.Wait();
  EXPECT_EQ(Replay("replay"), 0) << Log("replay");
  EXPECT_THAT(Log("replay"), HasSubstr("all decided as recorded"));
  EXPECT_THAT(Log("replay"), HasSubstr("was killed"));
}

TEST_F(DaemonJournal, WithoutAPlaceTheDaemonWorksAndAnAlarmSaysSo) {
  std::ofstream(folder_) << "a file";
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  EXPECT_TRUE(WaitUntil([&] { return HasAlarm("JournalMissing"); }, kPatienceMs));
  MoveUnits();
  std::filesystem::remove(folder_);
  EXPECT_TRUE(WaitUntil([&] { return !HasAlarm("JournalMissing"); }, kPatienceMs));
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0);
  EXPECT_EQ(Replay("replay"), 0) << Log("replay") << " (all steps waited in memory)";
}

TEST_F(DaemonJournal, WithALimitOfZeroThereIsNone) {
  Configure("[bus]\nport = \"simulated\"\n[journal]\nlimit_MiB = 0\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  EXPECT_FALSE(std::filesystem::exists(folder_));
  EXPECT_EQ(Replay("replay"), 1);
  EXPECT_THAT(Log("replay"), HasSubstr("no such file or folder"));
}

TEST_F(DaemonJournal, ReplayAndConfigurationExcludeEachOther) {
  EXPECT_EQ(Run({"--replay", "x", "--config", "y"}), 2);
  EXPECT_EQ(Run({}), 2);
  EXPECT_THAT(Log(), HasSubstr("--config is required"));
}

}  // namespace
}  // namespace focalfleet
