// The real focalfleetd and the port of its metrics.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

#include "tests/daemon/process/focalfleetd_fixture.h"
#include "tests/support/process.h"

namespace focalfleet {
namespace {

using test::FocalfleetdTest;
using test::kPatienceMs;
using test::WaitUntil;
using ::testing::HasSubstr;
using ::testing::Not;

sockaddr_in Loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

bool Accepts(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(port);
  const bool accepts =
      ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(fd);
  return accepts;
}

TEST_F(FocalfleetdTest, WorksOnWhereThePortOfItsMetricsIsInUseAndServesThemLater) {
  const int squatter = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(squatter, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(squatter, 1), 0);
  ASSERT_EQ(::getsockname(squatter, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const std::uint16_t port = ntohs(address.sin_port);
  Configure("[bus]\nport = \"simulated\"\n[metrics]\nport = " + std::to_string(port) + "\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  EXPECT_TRUE(
      WaitUntil([&] { return Log().find("no metrics") != std::string::npos; }, kPatienceMs));
  EXPECT_THAT(Log(), HasSubstr("cannot listen on 127.0.0.1 port " + std::to_string(port)));
  const auto alarm_is_stored = [&] {
    const auto history = Ask("history");
    return history && (*history)["alarms"].dump().find("no metrics") != std::string::npos;
  };
  EXPECT_TRUE(WaitUntil(alarm_is_stored, kPatienceMs));
  ::close(squatter);
  EXPECT_TRUE(WaitUntil([&] { return Accepts(port); }, kPatienceMs)) << Log();
  EXPECT_TRUE(WaitUntil([&] { return Log().find("metrics are served again") != std::string::npos; },
                        kPatienceMs));
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.WaitFor(kPatienceMs), 0) << Log();
  EXPECT_FALSE(Accepts(port));
}

TEST_F(FocalfleetdTest, ServesNoMetricsUnlessConfigured) {
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  EXPECT_THAT(Log(), Not(HasSubstr("metrics")));
}

}  // namespace
}  // namespace focalfleet
