#include "daemon/metrics/metrics_endpoint.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/support/process.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class MetricsEndpointTest : public ::testing::Test {
 protected:
  MetricsEndpointTest()
      : endpoint_({.values = &values_,
                   .work = &work_,
                   .store_path = "",
                   .now = [this] { return now_.load(); }},
                  {.address = "127.0.0.1"}) {}

  std::string Get(const std::string& path) {
    EXPECT_TRUE(test::WaitUntil([&] { return endpoint_.port() != 0; }, 30'000));
    const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(endpoint_.port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const std::string request = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
    EXPECT_EQ(::send(fd, request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    std::string text;
    char buffer[4096];
    for (ssize_t got = 0; (got = ::recv(fd, buffer, sizeof buffer, 0)) > 0;)
      text.append(buffer, static_cast<std::size_t>(got));
    ::close(fd);
    return text;
  }
  void Put(WallTime at, std::uint64_t steps) {
    FleetMetrics values;
    values.at = at;
    values.steps = steps;
    values_.Put(std::make_unique<const FleetMetrics>(values));
  }

  NewestValue<const FleetMetrics> values_;
  WorkCounters work_;
  std::atomic<WallTime> now_{WallTime{1'000'000'000'000}};
  MetricsEndpoint endpoint_;
};

TEST_F(MetricsEndpointTest, AnswersWithTheNewestValues) {
  EXPECT_THAT(Get("/metrics"), StartsWith("HTTP/1.1 503")) << "there are none yet";
  EXPECT_THAT(Get("/healthz"), StartsWith("HTTP/1.1 503"));
  Put(now_, 7);
  const std::string page = Get("/metrics");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, HasSubstr("Content-Type: text/plain; version=0.0.4; charset=utf-8\r\n"));
  EXPECT_THAT(page, HasSubstr("\nfocalfleet_core_steps_total 7\n"));
  EXPECT_THAT(Get("/metrics"), HasSubstr("\nfocalfleet_core_steps_total 7\n")) << "nothing newer";
  Put(now_, 8);
  Put(now_, 9);
  EXPECT_THAT(Get("/metrics"), HasSubstr("\nfocalfleet_core_steps_total 9\n"));
}

TEST_F(MetricsEndpointTest, IsIllWhenTheCoreHandsOutNothing) {
  Put(now_, 1);
  now_ = WallTime{now_.load().ns + 10'000'000'000};
  EXPECT_THAT(Get("/healthz"), StartsWith("HTTP/1.1 200"));
  now_ = WallTime{now_.load().ns + 1'000'000'000};
  const std::string ill = Get("/healthz");
  EXPECT_THAT(ill, StartsWith("HTTP/1.1 503"));
  EXPECT_THAT(ill, HasSubstr("for 11 s"));
  EXPECT_THAT(Get("/metrics"), StartsWith("HTTP/1.1 200")) << "its age is in it";
  Put(now_, 2);
  EXPECT_THAT(Get("/healthz"), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace focalfleet
