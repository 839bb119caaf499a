#include "daemon/systemd/notify_socket.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <map>
#include <string>

#include "tests/support/datagram_inbox.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::DatagramInbox;
using test::ScratchFolder;

/// An environment of these variables alone. `variables` outlives it.
Environment Of(const std::map<std::string, std::string>& variables) {
  return [&variables](const char* name) {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  };
}

TEST(NotifySocket, SendsToAPath) {
  const ScratchFolder scratch;
  const DatagramInbox manager(scratch / "notify");
  const std::map<std::string, std::string> variables{{"NOTIFY_SOCKET", scratch / "notify"}};
  const NotifySocket socket = NotifySocket::FromEnvironment(Of(variables));
  ASSERT_TRUE(socket.present());
  EXPECT_TRUE(socket.Send("READY=1\nSTATUS=here"));
  EXPECT_EQ(manager.Next(), "READY=1\nSTATUS=here");
}

TEST(NotifySocket, SendsToAnAbstractName) {
  const std::string name = "@focalfleet-notify-test-" + std::to_string(getpid());
  const DatagramInbox manager(name);
  const std::map<std::string, std::string> variables{{"NOTIFY_SOCKET", name}};
  const NotifySocket socket = NotifySocket::FromEnvironment(Of(variables));
  EXPECT_TRUE(socket.Send("WATCHDOG=1"));
  EXPECT_EQ(manager.Next(), "WATCHDOG=1");
}

TEST(NotifySocket, IsAbsentWithoutAnAddress) {
  for (const std::string& address :
       {std::string(), std::string("/"), std::string("notify"), "/" + std::string(200, 'x')}) {
    const std::map<std::string, std::string> variables{{"NOTIFY_SOCKET", address}};
    const NotifySocket socket = NotifySocket::FromEnvironment(Of(variables));
    EXPECT_FALSE(socket.present()) << address;
    EXPECT_FALSE(socket.Send("READY=1"));
  }
  EXPECT_FALSE(NotifySocket::FromEnvironment(Of({})).present());
}

TEST(NotifySocket, NeverWaitsForAManagerThatDoesNotRead) {
  const ScratchFolder scratch;
  const DatagramInbox manager(scratch / "notify");
  const std::map<std::string, std::string> variables{{"NOTIFY_SOCKET", scratch / "notify"}};
  const NotifySocket socket = NotifySocket::FromEnvironment(Of(variables));
  bool full = false;
  for (int i = 0; i < 100'000 && !full; ++i) full = !socket.Send("STATUS=again");
  EXPECT_TRUE(full);
  ASSERT_TRUE(manager.Next());
  EXPECT_TRUE(socket.Send("STATUS=there is room again"));
}

TEST(NotifySocket, TheManagerMayBeGone) {
  const ScratchFolder scratch;
  const std::map<std::string, std::string> variables{{"NOTIFY_SOCKET", scratch / "nobody"}};
  EXPECT_FALSE(NotifySocket::FromEnvironment(Of(variables)).Send("READY=1"));
}

TEST(WatchdogInterval, IsTheOneOfThisProcess) {
  const std::string own = std::to_string(getpid());
  const auto interval = [](const std::map<std::string, std::string>& variables) {
    return WatchdogInterval(Of(variables));
  };
  EXPECT_EQ(interval({{"WATCHDOG_USEC", "30000000"}}), Seconds(30));
  EXPECT_EQ(interval({{"WATCHDOG_USEC", "500000"}, {"WATCHDOG_PID", own}}), Milliseconds(500));
  EXPECT_EQ(interval({{"WATCHDOG_USEC", "500000"}, {"WATCHDOG_PID", "1"}}), std::nullopt);
  EXPECT_EQ(interval({{"WATCHDOG_USEC", "500000"}, {"WATCHDOG_PID", "me"}}), std::nullopt);
  EXPECT_EQ(interval({}), std::nullopt);
  for (const char* odd : {"", "0", "-5", "12s", "99999999999999999999"})
    EXPECT_EQ(interval({{"WATCHDOG_USEC", odd}}), std::nullopt) << odd;
}

}  // namespace
}  // namespace focalfleet
