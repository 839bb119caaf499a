// What needs no CAN in the kernel; tests/can has the rest.
#include "daemon/ports/socketcan_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

can_frame ErrorFrame(std::uint32_t classes, std::uint8_t controller = 0) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | classes;
  frame.len = CAN_ERR_DLC;
  frame.data[1] = controller;
  return frame;
}

TEST(SocketCanPort, IsDownAndNamesTheInterfaceThatIsMissing) {
  const auto port = SocketCanPort::Create({.bus = BusId{1}, .interface = "nocan7"});
  ASSERT_TRUE(port) << port.error().text;
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_FALSE((*port)->found());
  EXPECT_THAT((*port)->trouble(), HasSubstr("nocan7"));
}

// A socket pair in place of the interface, as soon as it is `there`.
struct Interface {
  Interface() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0); }
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;
  ~Interface() {
    ::close(ends[0]);
    ::close(ends[1]);
  }
  Result<int> Open(const std::string& name) const {
    if (!there) return Fail(ErrorCode::kUnavailable, "no CAN interface '" + name + "'");
    return up ? ::dup(ends[0]) : -1;
  }
  int ends[2] = {-1, -1};
  bool there = false;
  bool up = true;
};

TEST(SocketCanPort, FindsAnInterfaceThatComesLaterAndCountsOnlyTheNextTimes) {
  Interface interface;
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1}, .interface = "can7", .open = [&](const std::string& name) {
         return interface.Open(name);
       }});
  ASSERT_TRUE(port) << port.error().text;
  EXPECT_EQ((*port)->trouble(), "no CAN interface 'can7'");
  std::vector<ReceivedFrame> in;
  const auto receive_at = [&](std::int64_t ms) {
    (*port)->Receive(HostInstant{} + Milliseconds(ms), &in);
    return (*port)->state();
  };
  EXPECT_EQ(receive_at(1000), LinkState::kDown);
  EXPECT_EQ((*port)->wake_at(), HostInstant{} + Milliseconds(1200));
  interface.there = true;
  interface.up = false;
  EXPECT_EQ(receive_at(1100), LinkState::kDown) << "not before its time";
  EXPECT_FALSE((*port)->found());
  EXPECT_EQ(receive_at(1200), LinkState::kDown);
  EXPECT_TRUE((*port)->found());
  EXPECT_EQ((*port)->trouble(), "the interface is down");
  interface.up = true;
  EXPECT_EQ(receive_at(1400), LinkState::kUp);
  EXPECT_EQ((*port)->trouble(), "");
  EXPECT_EQ((*port)->counters().reconnects, 0u) << "the first time it came up";
  // The other end is gone: what is sent is refused.
  ::shutdown(interface.ends[0], SHUT_RDWR);
  const CanFrame frame{.id = 77, .length = 0, .data = {}};
  EXPECT_EQ((*port)->Send({&frame, 1}), 0u);
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_EQ(receive_at(1600), LinkState::kUp);
  EXPECT_EQ((*port)->counters().reconnects, 1u);
}

TEST(SocketCanPort, RefusesANameThatNoInterfaceCanHave) {
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1}, .interface = "can7", .open = [](const std::string&) -> Result<int> {
         return Fail(ErrorCode::kInvalid, "no CAN interface can be called so");
       }});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kInvalid);
}

TEST(SocketCanPort, ReadsTheControllersStateFromErrorFrames) {
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_BUSOFF)), LinkState::kOff);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_RESTARTED)), LinkState::kUp);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE)), LinkState::kPassive);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE)), LinkState::kPassive);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE)), LinkState::kUp);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW)), std::nullopt);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_TX_TIMEOUT)), std::nullopt);
}

}  // namespace
}  // namespace focalfleet
