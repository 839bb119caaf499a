// These tests run SocketCanPort on an interface that takes its time: vcan0 that echoes like a real
// driver, behind a queue of 1 Mbit/s (tests/can/slow-bus). A listener of the test counts the frames
// below the socket. The script slow-bus also lets the queue hold no more than three frames, so the
// kernel itself would count a fourth as dropped.
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <vector>

#include "daemon/ports/socketcan_port.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

constexpr int kPatienceMs = 10'000;  // a hang ends here; nothing is timed

// Sees each frame when the queue has let it go.
class Listener {
 public:
  Listener() : fd_(socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex("vcan0"));
    const auto* raw = static_cast<const sockaddr*>(static_cast<const void*>(&address));
    EXPECT_EQ(bind(fd_, raw, sizeof address), 0);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener() { close(fd_); }

  const std::vector<canid_t>& Seen() {
    can_frame frame{};
    while (read(fd_, &frame, sizeof frame) == static_cast<ssize_t>(sizeof frame))
      seen_.push_back(frame.can_id & CAN_EFF_MASK);
    return seen_;
  }

 private:
  int fd_;
  std::vector<canid_t> seen_;
};

std::unique_ptr<SocketCanPort> OpenPort() {
  auto port = SocketCanPort::Create({.bus = {3}, .interface = "vcan0"});
  EXPECT_TRUE(port) << port.error().text;
  return port ? std::move(*port) : nullptr;
}

TEST(SlowBus, AtMostThreeOfOursAreBelowAndAStopWaitsForTwo) {
  const auto port = OpenPort();
  ASSERT_TRUE(port);
  ASSERT_TRUE(port->link().echoes) << "vcan must be loaded with echo=1";
  Listener listener;
  const CanFrame stop = Encode(HostMessage(Stop{}), {kBroadcastNode, 0});
  const CanFrame other = Encode(HostMessage(StageSegment{Axis::kTheta, 1, {5, 6, 7}}), {{4}, 0});
  constexpr std::size_t kFrames = 3000;
  constexpr std::size_t kStopEvery = 37;
  std::size_t sent = 0;
  std::size_t below_max = 0;
  std::array<int, 4> stops_by_wait{};
  std::vector<std::pair<std::size_t, std::size_t>> stops;  // place on the wire, frames ahead of it
  std::vector<ReceivedFrame> in;
  while (sent < kFrames) {
    pollfd wait{port->fd(), POLLIN, 0};
    if (sent > 0 && poll(&wait, 1, kPatienceMs) <= 0) break;
    port->Receive(HostInstant{1}, &in);
    const std::size_t seen = listener.Seen().size();
    const std::array<CanFrame, 8> batch{other, other, other, other, other, other, other, other};
    sent += port->Send(batch);
    if (stops.size() < sent / kStopEvery) {
      const std::size_t ahead = sent - seen;
      ASSERT_EQ(port->Send({&stop, 1}), 1u) << "there is always a place for a stop";
      stops.push_back({sent, ahead});
      ++stops_by_wait.at(ahead);
      ++sent;
    }
    below_max = std::max(below_max, sent - seen);
  }
  while (listener.Seen().size() < sent) {
    pollfd wait{port->fd(), POLLIN, 0};
    ASSERT_GT(poll(&wait, 1, kPatienceMs), 0);
    port->Receive(HostInstant{1}, &in);
  }
  EXPECT_GE(sent, kFrames);
  EXPECT_LE(below_max, TransmitWindow::kAll);
  for (const auto& [place, ahead] : stops) {
    EXPECT_EQ(listener.Seen()[place], stop.id);
    EXPECT_LE(ahead, TransmitWindow::kOrdinary);
  }
  std::printf(
      "%zu frames, at most %zu below the socket; stops that waited for 0, 1, 2 frames: %d, "
      "%d, %d\n",
      sent, below_max, stops_by_wait[0], stops_by_wait[1], stops_by_wait[2]);
}

// A group is one frame below, and one confirmation. With more or none, the test would halt, or drop
// frames in a queue that holds three.
TEST(SlowBus, AtMostTwoGroupsAreBelowAndEachIsConfirmed) {
  auto created =
      SocketCanPort::Create({.bus = {3}, .interface = "vcan0", .data_bit_rate_bps = 2'000'000});
  ASSERT_TRUE(created) << created.error().text;
  SocketCanPort& port = **created;
  ASSERT_TRUE(port.link().echoes) << "vcan must be loaded with echo=1";
  std::vector<CanFrame> frames;
  for (std::uint8_t n = 0; n < 200; ++n)
    frames.push_back(Encode(HostMessage(StageSegment{Axis::kTheta, 1, {5, 6, 7}}), {{n}, 0}));
  for (std::uint8_t n = 0; n < 100; ++n)  // these are sent alone
    frames.push_back(Encode(HostMessage(Arm{MoveId{1}, 7}), {{n}, 1}));
  std::vector<ReceivedFrame> in;
  for (int round = 0; round < 5; ++round) {
    std::size_t sent = 0;
    while (sent < frames.size()) {
      const std::size_t now = port.Send(std::span(frames).subspan(sent));
      EXPECT_LE(now, TransmitWindow::kOrdinary * 5);
      sent += now;
      pollfd wait{port.fd(), POLLIN, 0};
      ASSERT_GT(poll(&wait, 1, kPatienceMs), 0) << "no confirmation comes";
      port.Receive(HostInstant{1}, &in);
    }
  }
  EXPECT_TRUE(in.empty());
  EXPECT_EQ(port.counters().rejected, 0u);
  EXPECT_EQ(port.counters().link_errors, 0u) << "a confirmation was given up";
}

// Another program on this host floods the interface: ENOBUFS, no loss, no link down.
TEST(SlowBus, AQueueThatOthersFillIsWaitedFor) {
  const auto port = OpenPort();
  ASSERT_TRUE(port);
  const int other = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex("vcan0"));
  const auto* raw = static_cast<const sockaddr*>(static_cast<const void*>(&address));
  ASSERT_EQ(bind(other, raw, sizeof address), 0);
  can_frame flood{};
  flood.can_id = CAN_EFF_FLAG | 1;
  bool full = false;
  for (int i = 0; i < 100 && !full; ++i)
    full = write(other, &flood, sizeof flood) < 0 && errno == ENOBUFS;
  EXPECT_TRUE(full);
  const CanFrame frame = Encode(HostMessage(IdentifyRequest{}), {{4}, 1});
  EXPECT_EQ(port->Send({&frame, 1}), 0u);
  EXPECT_EQ(port->state(), LinkState::kUp);
  std::size_t taken = 0;
  for (int i = 0; i < kPatienceMs && taken == 0; ++i) {
    poll(nullptr, 0, 1);  // as the caller does: retry_full
    taken = port->Send({&frame, 1});
  }
  EXPECT_EQ(taken, 1u);
  close(other);
}

}  // namespace
}  // namespace focalfleet
