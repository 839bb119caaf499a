// What needs no CAN in the kernel; tests/can has the rest.
#include "daemon/ports/socketcan_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>

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

TEST(SocketCanPort, NamesTheInterfaceThatIsMissing) {
  const auto port = SocketCanPort::Create({.bus = BusId{1}, .interface = "nocan7"});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(port.error().text, HasSubstr("nocan7"));
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
