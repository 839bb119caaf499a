// Frames that a port misses: the kernel has lost them, or another program of this host forged them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>

#include "daemon/ports/socketcan_port.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// As recvmmsg; all frames are marked as sent on this host.
int ReceiveLocal(int fd, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  const int got = ::recvmmsg(fd, messages, count, flags, timeout);
  for (int k = 0; k < got; ++k) messages[k].msg_hdr.msg_flags |= MSG_DONTROUTE;
  return got;
}

/// As recvmmsg; the kernel reports three lost frames with each.
int ReceiveLosing(int fd, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  static char control[CMSG_SPACE(sizeof(std::uint32_t))];
  const int got = ::recvmmsg(fd, messages, count, flags, timeout);
  for (int k = 0; k < got; ++k) {
    msghdr& header = messages[k].msg_hdr;
    header.msg_control = control;
    header.msg_controllen = sizeof control;
    cmsghdr* const item = CMSG_FIRSTHDR(&header);
    *item = {.cmsg_len = CMSG_LEN(sizeof(std::uint32_t)),
             .cmsg_level = SOL_SOCKET,
             .cmsg_type = SO_RXQ_OVFL};
    const std::uint32_t lost = 3;
    std::memcpy(CMSG_DATA(item), &lost, sizeof lost);
  }
  return got;
}

struct Missed {
  SystemReceive receive;
  const char* kind;
  std::uint64_t forged, lost;
  std::size_t heard;
  const char* trouble;
};

TEST(SocketCanPort, FramesThatAreForgedOrLostAreATroubleForAWhile) {
  for (const Missed& each : {Missed{ReceiveLocal, "can", 1, 0, 0, "a program of this host"},
                             Missed{ReceiveLocal, "vcan", 0, 0, 1, ""},
                             Missed{ReceiveLosing, "can", 0, 3, 1, "frames were lost"}}) {
    int ends[2];
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    const auto port = SocketCanPort::Create(
        {.bus = BusId{1},
         .interface = "can7",
         .open = [&](const std::string&, const Listening&) -> Result<OpenedInterface> {
           CanLink link;
           link.kind = each.kind;
           return OpenedInterface{ends[0], link};
         },
         .receive = each.receive});
    ASSERT_TRUE(port) << port.error().text;
    can_frame frame{};
    frame.can_id = CAN_EFF_FLAG | 1u << 19;  // as from a unit
    ASSERT_EQ(::send(ends[1], &frame, sizeof frame, 0), ssize_t{sizeof frame});
    std::vector<ReceivedFrame> in;
    (*port)->Receive(HostInstant{0} + Seconds(1), &in);
    EXPECT_EQ(in.size(), each.heard);
    EXPECT_EQ((*port)->counters().forged, each.forged);
    EXPECT_EQ((*port)->counters().lost, each.lost);
    EXPECT_THAT((*port)->trouble(), HasSubstr(each.trouble));
    EXPECT_EQ((*port)->trouble().empty(), *each.trouble == 0);
    (*port)->Receive(HostInstant{0} + Seconds(62), &in);
    EXPECT_EQ((*port)->trouble(), "") << "it is over";
    ::close(ends[1]);
  }
}

}  // namespace
}  // namespace focalfleet
