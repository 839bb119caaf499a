#include "daemon/ports/socket_frames.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>

namespace focalfleet {
namespace {

constexpr ReceivedFrame kStamp{.bus = BusId{7}, .at = HostInstant{42}, .frame = {}};

class Pair {
 public:
  Pair() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, fds_.data()), 0); }
  ~Pair() {
    ::close(fds_[0]);
    ::close(fds_[1]);
  }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;
  [[nodiscard]] int a() const { return fds_[0]; }
  [[nodiscard]] int b() const { return fds_[1]; }
  template <class T>
  void Write(const T& packet) const {
    EXPECT_EQ(::send(a(), &packet, sizeof packet, 0), static_cast<ssize_t>(sizeof packet));
  }

 private:
  std::array<int, 2> fds_{-1, -1};
};

std::vector<CanFrame> ManyFrames(std::uint32_t count) {
  std::vector<CanFrame> frames(count);
  for (std::uint32_t i = 0; i < count; ++i)
    frames[i] = {.id = i, .length = 4, .data = {1, 2, 3, 4}};
  return frames;
}

TEST(SocketFrames, FrameSurvivesTheWay) {
  const CanFrame frame{.id = kCanIdMax, .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
  const can_frame raw = ToSocketFrame(frame);
  EXPECT_EQ(raw.can_id, CAN_EFF_FLAG | CAN_EFF_MASK);
  EXPECT_EQ(FromSocketFrame(raw), frame);
}

TEST(SocketFrames, OnlyExtendedDataFramesAreFrames) {
  can_frame raw = ToSocketFrame(CanFrame{.id = 5, .length = 2, .data = {9, 9}});
  raw.can_id = 5;  // 11 bits
  EXPECT_FALSE(FromSocketFrame(raw));
  raw.can_id = 5 | CAN_EFF_FLAG | CAN_RTR_FLAG;
  EXPECT_FALSE(FromSocketFrame(raw));
  raw.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
  EXPECT_FALSE(FromSocketFrame(raw));
  raw.can_id = 5 | CAN_EFF_FLAG;
  raw.len = 9;
  EXPECT_FALSE(FromSocketFrame(raw));
}

TEST(SocketFrames, BytesPastTheLengthAreNobodys) {
  can_frame raw = ToSocketFrame(CanFrame{.id = 5, .length = 2, .data = {1, 2}});
  raw.data[5] = 0xee;
  EXPECT_EQ(FromSocketFrame(raw), (CanFrame{.id = 5, .length = 2, .data = {1, 2}}));
}

TEST(SocketFrames, BatchesKeepTheOrder) {
  const Pair pair;
  const auto frames = ManyFrames(150);
  const BatchSent sent = SendFrames(pair.a(), frames);
  EXPECT_EQ(sent.taken, frames.size());
  std::vector<ReceivedFrame> received;
  PortCounters counters;
  const BatchReceived end = ReceiveFrames(pair.b(), kStamp, &received, &counters);
  EXPECT_FALSE(end.closed);
  EXPECT_EQ(end.error, 0);
  ASSERT_EQ(received.size(), frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(received[i].frame, frames[i]);
  EXPECT_EQ(received[0].bus, kStamp.bus);
  EXPECT_EQ(received[0].at, kStamp.at);
}

TEST(SocketFrames, AFullSocketTakesAPart) {
  const Pair pair;
  const BatchSent sent = SendFrames(pair.a(), ManyFrames(100'000));
  EXPECT_GT(sent.taken, 0u);
  EXPECT_LT(sent.taken, 100'000u);
  EXPECT_EQ(sent.error, EAGAIN);
}

TEST(SocketFrames, WhatIsNoFrameIsCounted) {
  const Pair pair;
  pair.Write(std::array<char, 3>{});
  pair.Write(std::array<char, 72>{});
  pair.Write(can_frame{});  // 11 bits
  pair.Write(ToSocketFrame(CanFrame{.id = 1, .length = 0, .data = {}}));
  std::vector<ReceivedFrame> received;
  PortCounters counters;
  ReceiveFrames(pair.b(), kStamp, &received, &counters);
  EXPECT_EQ(received.size(), 1u);
  EXPECT_EQ(counters.rejected, 3u);
}

TEST(SocketFrames, ErrorFramesGoApart) {
  const Pair pair;
  can_frame error{};
  error.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
  error.len = CAN_ERR_DLC;
  pair.Write(error);
  std::vector<ReceivedFrame> received;
  Aside aside;
  PortCounters counters;
  ReceiveFrames(pair.b(), kStamp, &received, &counters, &aside);
  EXPECT_EQ(aside.errors.size(), 1u);
  EXPECT_EQ(counters.rejected, 0u);
}

}  // namespace
}  // namespace focalfleet
