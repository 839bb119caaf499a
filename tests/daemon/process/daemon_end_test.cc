// The end of the real focalfleetd, in every state of its work.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <utility>
#include <vector>

#include "daemon/control/line_client.h"
#include "tests/daemon/process/crowded_fleet.h"
#include "tests/daemon/process/focalfleetd_fixture.h"
#include "tests/support/process.h"

namespace focalfleet {
namespace {

using test::CrowdedFleet;
using test::FocalfleetdTest;
using test::kPatienceMs;
using test::Process;
using test::WaitUntil;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(FocalfleetdTest, EndsCleanlyOnSigterm) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
  EXPECT_NE(::access((scratch_ / "control.sock").c_str(), F_OK), 0) << "the socket is gone";
  EXPECT_THAT(Log(), HasSubstr("all is stored"));
}

/// Checks all that has to be true after a good end of the daemon.
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
  /// The next daemon reads the store, and finds the configuration ended.
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

class CrowdedFocalfleetdEndTest : public FocalfleetdEndTest {
 protected:
  const CrowdedFleet fleet_{scratch_ / ""};
};

TEST_F(CrowdedFocalfleetdEndTest, DoesNotWaitForAPlanThatTakesAMinute) {
  auto daemon = Start();
  ASSERT_TRUE(WaitUntil(
      [&] {
        const auto status = Ask("status");
        return status && (*status)["phases"]["ready"] == CrowdedFleet::kUnits;
      },
      kPatienceMs))
      << Log();
  fleet_.StandAt(1);
  const auto taken = Ask("apply", {{"targets_csv", fleet_.Targets(2)}});
  ASSERT_TRUE(taken) << taken.error().text;
  ASSERT_TRUE(Reaches("planning")) << Log();
  ExpectEndOn(SIGTERM, &daemon);
  EXPECT_THAT(Log(), Not(HasSubstr("left behind")))
      << "the planner stopped because its plan was not wanted";
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

// The FIFO stands for a file system that is gone: opening it waits for ever.
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

TEST_F(FocalfleetdEndTest, WaitingClientsReceiveTheEndAndTheBusesAreFree) {
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

// The camera may be another user: links in its folder are not followed, pipes are not waited for.
TEST_F(FocalfleetdTest, EndsWithAnyFileInTheCamerasFolder) {
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
  // A daemon that follows links would have written its request by now, or would wait for a pipe.
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0) << Log();
  std::ifstream secret(scratch_ / "secret");
  std::string text;
  secret >> text;
  EXPECT_EQ(text, "secret");
}

}  // namespace
}  // namespace focalfleet
