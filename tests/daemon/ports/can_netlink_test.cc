#include "daemon/ports/can_netlink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>

#include <cerrno>
#include <cstring>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

// Answer is a message as the kernel lays it out, put together here by hand.
class Answer {
 public:
  template <class T>
  Answer& Put(const T& value) {
    const auto* from = static_cast<const std::byte*>(static_cast<const void*>(&value));
    bytes.insert(bytes.end(), from, from + sizeof value);
    return *this;
  }
  Answer& Text(const char* text) {
    for (const char* c = text; *c != 0; ++c) Put(*c);
    return Put('\0');
  }
  Answer& Attribute(std::uint16_t type, const Answer& payload) {
    Put(static_cast<std::uint16_t>(4 + payload.bytes.size())).Put(type);
    bytes.insert(bytes.end(), payload.bytes.begin(), payload.bytes.end());
    while (bytes.size() % 4 != 0) bytes.push_back(std::byte{0});
    return *this;
  }
  [[nodiscard]] NetlinkMessage Message(std::uint16_t type) const {
    Answer message;
    message.Put(static_cast<std::uint32_t>(16 + bytes.size())).Put(type);
    message.Put(std::uint16_t{0}).Put(std::uint32_t{1}).Put(std::uint32_t{77});
    message.bytes.insert(message.bytes.end(), bytes.begin(), bytes.end());
    return message.bytes;
  }
  NetlinkMessage bytes;
};

constexpr std::uint16_t kCanHardware = 280;
Answer Head(std::uint32_t flags) {
  Answer head;
  head.Put(std::uint8_t{0}).Put(std::uint8_t{0}).Put(kCanHardware);
  return head.Put(std::int32_t{5}).Put(flags).Put(std::uint32_t{0});
}

NetlinkMessage Controller() {
  can_bittiming timing{};
  timing.bitrate = 500'000;
  Answer can;
  can.Attribute(IFLA_CAN_BITTIMING, Answer().Put(timing));
  can.Attribute(IFLA_CAN_STATE, Answer().Put(std::uint32_t{CAN_STATE_ERROR_PASSIVE}));
  can.Attribute(IFLA_CAN_RESTART_MS, Answer().Put(std::uint32_t{250}));
  can.Attribute(IFLA_CAN_BERR_COUNTER, Answer().Put(can_berr_counter{.txerr = 130, .rxerr = 7}));
  Answer info;
  info.Attribute(IFLA_INFO_KIND, Answer().Text("can"));
  info.Attribute(IFLA_INFO_DATA, can);
  return Head(IFF_UP | 1u << 18)
      .Attribute(IFLA_IFNAME, Answer().Text("can3"))
      .Attribute(IFLA_LINKINFO, info)
      .Message(RTM_NEWLINK);
}

TEST(CanNetlink, ReadsAController) {
  const auto link = ReadLink(Controller());
  ASSERT_TRUE(link) << link.error().text;
  EXPECT_EQ(link->index, 5);
  EXPECT_TRUE(link->can);
  EXPECT_TRUE(link->up);
  EXPECT_TRUE(link->echoes);
  EXPECT_TRUE(link->real());
  EXPECT_EQ(link->kind, "can");
  EXPECT_EQ(link->bit_rate_bps, 500'000u);
  EXPECT_EQ(link->state, ControllerState::kPassive);
  EXPECT_EQ(link->restart_ms, 250u);
  EXPECT_EQ(link->tx_errors, 130);
  EXPECT_EQ(link->rx_errors, 7);
}

TEST(CanNetlink, ReadsWhatCanFdNeeds) {
  can_bittiming timing{};
  timing.bitrate = 500'000;
  can_bittiming data{};
  data.bitrate = 4'000'000;
  Answer can;
  can.Attribute(IFLA_CAN_BITTIMING, Answer().Put(timing));
  can.Attribute(IFLA_CAN_DATA_BITTIMING, Answer().Put(data));
  Answer info;
  info.Attribute(IFLA_INFO_KIND, Answer().Text("can"));
  info.Attribute(IFLA_INFO_DATA, can);
  const auto link = ReadLink(Head(IFF_UP)
                                 .Attribute(IFLA_MTU, Answer().Put(std::uint32_t{72}))
                                 .Attribute(IFLA_TXQLEN, Answer().Put(std::uint32_t{10}))
                                 .Attribute(IFLA_LINKINFO, info)
                                 .Message(RTM_NEWLINK));
  ASSERT_TRUE(link) << link.error().text;
  EXPECT_EQ(link->bit_rate_bps, 500'000u);
  EXPECT_EQ(link->data_bit_rate_bps, 4'000'000u);
  EXPECT_EQ(link->mtu, 72u);
  EXPECT_EQ(link->queue_frames, 10u);
  const auto without = ReadLink(Controller());
  ASSERT_TRUE(without);
  EXPECT_EQ(without->data_bit_rate_bps, 0u);
}

TEST(CanNetlink, AVirtualInterfaceHasNoBitTiming) {
  Answer info;
  info.Attribute(IFLA_INFO_KIND, Answer().Text("vcan"));
  const auto link = ReadLink(Head(0).Attribute(IFLA_LINKINFO, info).Message(RTM_NEWLINK));
  ASSERT_TRUE(link) << link.error().text;
  EXPECT_FALSE(link->up);
  EXPECT_FALSE(link->echoes);
  EXPECT_FALSE(link->real());
  EXPECT_EQ(link->bit_rate_bps, 0u);
  EXPECT_EQ(link->state, std::nullopt);
}

TEST(CanNetlink, TheKernelsRefusalIsReported) {
  const auto refusal = Answer().Put(std::int32_t{-ENODEV}).Put(nlmsghdr{}).Message(NLMSG_ERROR);
  const auto link = ReadLink(refusal);
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(link.error().text, std::strerror(ENODEV));
  EXPECT_EQ(ReadAcknowledgement(refusal).value(), ENODEV);
  EXPECT_EQ(ReadAcknowledgement(Answer().Put(std::int32_t{0}).Put(nlmsghdr{}).Message(NLMSG_ERROR))
                .value(),
            0);
  EXPECT_FALSE(ReadAcknowledgement(Controller()));
  for (const std::int32_t none : {1, -4096, INT32_MIN})
    EXPECT_FALSE(ReadAcknowledgement(Answer().Put(none).Put(nlmsghdr{}).Message(NLMSG_ERROR)))
        << none;
}

// No bytes make the reader crash or read past the end (the sanitizers check the latter).
TEST(CanNetlink, CutAndSpoiltAnswersAreRefusedOrRead) {
  const NetlinkMessage whole = Controller();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<long>(size));
    EXPECT_FALSE(ReadLink(cut)) << size;
  }
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int read = 0;
  for (int i = 0; i < 20'000; ++i) {
    NetlinkMessage spoilt = whole;
    for (int k = 0; k < 3; ++k)
      spoilt[rng.Below(spoilt.size())] = static_cast<std::byte>(rng.Below(256));
    const std::vector<std::byte> exact(spoilt.begin(), spoilt.end());
    read += ReadLink(exact).has_value() ? 1 : 0;
  }
  EXPECT_GT(read, 0);
  EXPECT_LT(read, 20'000);
}

TEST(CanNetlink, MessagesAreAsLongAsTheySay) {
  for (const NetlinkMessage& message :
       {QuestionAboutLink("can0").value(), OrderToRestart(5), OrderToRaise(5, true)}) {
    std::uint32_t length = 0;
    std::memcpy(&length, message.data(), sizeof length);
    EXPECT_EQ(length, message.size());
    EXPECT_EQ(length % 4, 0u);
  }
  const auto bad = QuestionAboutLink("can-of-a-long-name");
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(QuestionAboutLink(""));
}

// Every Linux has the loopback interface, which is not CAN.
TEST(CanNetlink, LoopbackIsNoCan) {
  const auto link = LookAtLink("lo");
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().text, "'lo' is no CAN interface");
  const auto none = LookAtLink("nocan7");
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().text, HasSubstr("no CAN interface 'nocan7': No such device"));
}

}  // namespace
}  // namespace focalfleet
