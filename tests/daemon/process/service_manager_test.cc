// The real focalfleetd under a service manager that the test plays.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/daemon/process/crowded_fleet.h"
#include "tests/daemon/process/focalfleetd_fixture.h"
#include "tests/support/datagram_inbox.h"
#include "tests/support/process.h"

namespace focalfleet {
namespace {

using test::CrowdedFleet;
using test::DatagramInbox;
using test::FocalfleetdTest;
using test::kPatienceMs;
using test::Process;
using test::WaitUntil;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class ServiceManagerTest : public FocalfleetdTest {
 protected:
  /// The daemon with these variables in its environment, as NAME=VALUE.
  [[nodiscard]] Process StartWith(const std::vector<std::string>& variables) const {
    std::vector<std::string> arguments{"/usr/bin/env", "NOTIFY_SOCKET=" + (scratch_ / "notify")};
    arguments.insert(arguments.end(), variables.begin(), variables.end());
    arguments.insert(arguments.end(), {FOCALFLEETD, "--config", scratch_ / "f.toml"});
    return Process(arguments, scratch_ / "log");
  }
  /// The thread of the daemon that has this name; 0: there is none.
  [[nodiscard]] pid_t ThreadOf(pid_t daemon, const std::string& name) const {
    for (const auto& entry :
         std::filesystem::directory_iterator("/proc/" + std::to_string(daemon) + "/task")) {
      std::ifstream file(entry.path() / "comm");
      std::string comm;
      if (std::getline(file, comm) && comm == name)
        return static_cast<pid_t>(std::stol(entry.path().filename()));
    }
    return 0;
  }

  /// Stops the thread until the manager hears of the trouble. A thread that was stopped within a
  /// commit counts as waiting for the disk, so that it is let go and stopped anew.
  [[nodiscard]] bool Hang(pid_t thread, const std::string& trouble) const {
    constexpr int kTries = 3, kCommitEndsMs = 1000;
    for (int i = 0; i < kTries; ++i) {
      test::Pause(kCommitEndsMs);
      if (ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0) return false;
      if (ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0) return false;
      if (manager_.NextWith(trouble)) return true;
      if (ptrace(PTRACE_DETACH, thread, nullptr, nullptr) != 0) return false;
    }
    return false;
  }

  const DatagramInbox manager_{scratch_ / "notify"};
};

TEST_F(ServiceManagerTest, IsReadyWhenTheControlSocketAnswersAndSaysWhenItEnds) {
  auto daemon = StartWith({});
  const auto first = manager_.Next();
  ASSERT_TRUE(first) << Log();
  EXPECT_THAT(*first, StartsWith("READY=1\nSTATUS="));
  EXPECT_TRUE(Ask("status")) << "it was ready before it took commands";
  EXPECT_TRUE(manager_.NextWith("STATUS=2 of 2 units ready")) << Log();
  daemon.Signal(SIGTERM);
  EXPECT_TRUE(manager_.NextWith("STOPPING=1")) << Log();
  EXPECT_EQ(daemon.Wait(), 0) << Log();
}

TEST_F(ServiceManagerTest, TellsOfTheConfigurationUnderWay) {
  auto daemon = StartWith({});
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_TRUE(Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,180,90\n"}}));
  EXPECT_TRUE(manager_.NextWith("; configuration 1 is ")) << Log();
}

TEST_F(ServiceManagerTest, FeedsTheWatchdogWhileAllThreadsSleep) {
  auto daemon = StartWith({"WATCHDOG_USEC=1000000"});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(manager_.NextWith("WATCHDOG=1")) << Log();
}

TEST_F(ServiceManagerTest, FeedsNothingWithoutAnInterval) {
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 5\n");
  // A feed would come four times a second, and the configuration lasts for seconds.
  auto daemon = StartWith({"WATCHDOG_USEC=1000000", "WATCHDOG_PID=1"});
  ASSERT_TRUE(Ready()) << Log();
  ASSERT_TRUE(Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,40,90\n"}}));
  bool moved = false;
  bool ended = false;
  while (!ended) {
    const auto message = manager_.Next();
    ASSERT_TRUE(message) << Log();
    EXPECT_EQ(message->find("WATCHDOG"), std::string::npos) << *message;
    moved |= message->find("configuration 1 is moving") != std::string::npos;
    const bool rests = message->find("2 of 2 units ready") != std::string::npos &&
                       message->find("; configuration") == std::string::npos;
    if (moved && rests) daemon.Signal(SIGTERM);
    ended = message->find("STOPPING") != std::string::npos;
  }
  EXPECT_TRUE(moved && ended) << Log();
}

// A debugger stops a single thread; to the others it looks as if it hung in the kernel.
TEST_F(ServiceManagerTest, AThreadThatHangsIsNamedAndStopsTheFeed) {
  for (const char* name : {"store", "planner"}) {
    SCOPED_TRACE(name);
    auto daemon = StartWith({"WATCHDOG_USEC=2000000"});
    // Signs of life of the daemon before may still be in the inbox.
    ASSERT_TRUE(manager_.NextWith("READY=1")) << Log();
    ASSERT_TRUE(manager_.NextWith("WATCHDOG=1")) << Log();
    const pid_t thread = ThreadOf(daemon.pid(), name);
    ASSERT_GT(thread, 0);
    const std::string trouble = std::string("no answer from the ") + name + " thread";
    ASSERT_TRUE(Hang(thread, trouble)) << Log();
    EXPECT_THAT(Log(), HasSubstr(trouble));
    for (int i = 0; i < 100; ++i) EXPECT_TRUE(Ask("status")) << "the core goes on";
    EXPECT_FALSE(manager_.NextWith("WATCHDOG=1", 0)) << "it was fed while a thread hangs";
    ASSERT_EQ(ptrace(PTRACE_DETACH, thread, nullptr, nullptr), 0);
    EXPECT_TRUE(manager_.NextWith("WATCHDOG=1")) << Log();
    EXPECT_THAT(Log(), HasSubstr("all threads answer again"));
    daemon.Signal(SIGTERM);
    EXPECT_EQ(daemon.Wait(), 0) << Log();
  }
}

class CrowdedServiceManagerTest : public ServiceManagerTest {
 protected:
  const CrowdedFleet fleet_{scratch_ / ""};
};

TEST_F(CrowdedServiceManagerTest, APlanThatTakesLongIsAlive) {
  auto daemon = StartWith({"WATCHDOG_USEC=2000000"});
  ASSERT_TRUE(manager_.NextWith("300 of 300 units ready")) << Log();
  fleet_.StandAt(1);
  ASSERT_TRUE(Ask("apply", {{"targets_csv", fleet_.Targets(2)}}));
  ASSERT_TRUE(manager_.NextWith("is planning")) << Log();
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(manager_.NextWith("WATCHDOG=1")) << Log();
  const auto status = Ask("status");
  ASSERT_TRUE(status) << status.error().text;
  EXPECT_EQ((*status)["configuration"]["state"], "planning") << "the plan was no long one";
  EXPECT_EQ(Log().find("no answer"), std::string::npos) << Log();
}

TEST_F(ServiceManagerTest, OpensItsLogAnewOnHangup) {
  Configure("[bus]\nport = \"simulated\"\n[log]\nfile = \"d.log\"\n");
  auto daemon = StartWith({});
  ASSERT_TRUE(manager_.NextWith("READY=1")) << Log();
  ASSERT_EQ(std::rename((scratch_ / "d.log").c_str(), (scratch_ / "d.log.1").c_str()), 0);
  daemon.Signal(SIGHUP);
  const auto reloading = manager_.NextWith("RELOADING=1\nMONOTONIC_USEC=");
  ASSERT_TRUE(reloading) << Log();
  EXPECT_TRUE(manager_.NextWith("READY=1")) << Log();
  ASSERT_TRUE(Ask("disable", {{"unit_ids", {2}}, {"reason", "test"}}));
  EXPECT_TRUE(WaitUntil([&] { return Log("d.log").find("unit 2 disabled") != std::string::npos; },
                        kPatienceMs))
      << Log("d.log");
  EXPECT_EQ(Log("d.log.1").find("unit 2 disabled"), std::string::npos);
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0);
}

}  // namespace
}  // namespace focalfleet
