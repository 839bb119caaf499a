#include "daemon/ports/socket_frames.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <vector>

namespace focalfleet {
namespace {

const FrameSource kSource{.bus = BusId{7}, .clock = HostClock(1, [] { return std::int64_t{42}; })};

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

std::vector<CanFrame> ManyFrames(std::uint32_t count, std::uint32_t first_id = 0) {
  std::vector<CanFrame> frames(count);
  for (std::uint32_t i = 0; i < count; ++i)
    frames[i] = {.id = first_id + i, .length = 4, .data = {1, 2, 3, 4}};
  return frames;
}

/// As recvmmsg; the kernel marks each second packet as sent on this host, and each fourth as sent
/// by this socket.
int ReceiveMarked(int fd, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  const int got = ::recvmmsg(fd, messages, count, flags, timeout);
  for (int k = 1; k < got; k += 2)
    messages[k].msg_hdr.msg_flags |= MSG_DONTROUTE | (k % 4 == 3 ? MSG_CONFIRM : 0);
  return got;
}

TEST(SocketFrames, FramesOfOtherProgramsOfThisHostAreCountedAndNotBelieved) {
  const Pair pair;
  constexpr std::uint32_t kFromUnit = 1u << 19;
  for (const bool no_local : {true, false}) {
    ASSERT_EQ(SendFrames(pair.a(), ManyFrames(8, kFromUnit)).taken, 8u);
    Aside aside;
    aside.no_local = no_local;
    aside.receive = ReceiveMarked;
    std::vector<ReceivedFrame> heard;
    PortCounters counters;
    ReceiveFrames(pair.b(), kSource, &heard, &counters, &aside);
    EXPECT_EQ(aside.confirmed, 2u);
    EXPECT_EQ(counters.forged, no_local ? 2u : 0u);
    ASSERT_EQ(heard.size(), no_local ? 4u : 6u);
    EXPECT_EQ(heard[1].frame.id, kFromUnit + (no_local ? 2u : 1u));
  }
}

TEST(SocketFrames, AStopThatAnotherProgramOfThisHostSendsIsHeard) {
  const Pair pair;
  ASSERT_EQ(SendFrames(pair.a(), ManyFrames(2)).taken, 2u);
  Aside aside;
  aside.no_local = true;
  aside.receive = ReceiveMarked;
  std::vector<ReceivedFrame> heard;
  PortCounters counters;
  ReceiveFrames(pair.b(), kSource, &heard, &counters, &aside);
  EXPECT_EQ(heard.size(), 2u);
  EXPECT_EQ(counters.forged, 0u);
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
  const BatchReceived end = ReceiveFrames(pair.b(), kSource, &received, &counters);
  EXPECT_FALSE(end.closed);
  EXPECT_EQ(end.error, 0);
  ASSERT_EQ(received.size(), frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(received[i].frame, frames[i]);
  EXPECT_EQ(received[0].bus, kSource.bus);
  EXPECT_EQ(received[0].at, HostInstant{42});
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
  ReceiveFrames(pair.b(), kSource, &received, &counters);
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
  ReceiveFrames(pair.b(), kSource, &received, &counters, &aside);
  EXPECT_EQ(aside.errors.size(), 1u);
  EXPECT_EQ(counters.rejected, 0u);
}

/// The next readings of both clocks give these values.
std::vector<WallAhead> g_ahead;
WallAhead ReadPlanned() {
  const WallAhead next = g_ahead.front();
  g_ahead.erase(g_ahead.begin());
  return next;
}
constexpr std::int64_t kAheadNs = 1'700'000'000'000'000'000;
constexpr HostInstant At(std::int64_t ms) { return HostInstant{} + Milliseconds(ms); }

WallAhead Ahead(std::int64_t low_ms, std::int64_t high_ms) {
  return {kAheadNs + low_ms * 1'000'000, kAheadNs + high_ms * 1'000'000};
}
WallAhead Ahead(std::int64_t ms) { return Ahead(ms, ms); }

/// Returns the stamp of a frame that the kernel took in at 150 ms. The socket was found empty at
/// 100 ms, and the frame was read between 200 ms and 300 ms. `before` and `after` are what both
/// clocks showed at these two readings.
HostInstant StampAfter(WallAhead before, WallAhead after, std::int64_t stamp_ms = 150) {
  g_ahead = {before, before, after};
  FrameStamps stamps(ReadPlanned);
  stamps.HaveRead(At(100), At(101), /*empty=*/true);
  stamps.HaveRead(At(200), At(300), /*empty=*/true);
  return stamps.At(kAheadNs + stamp_ms * 1'000'000, HostClock());
}

TEST(FrameStamps, AreTheKernelsWhereBothClocksRanAlike) {
  EXPECT_EQ(StampAfter(Ahead(0), Ahead(0)), At(150));
}

TEST(FrameStamps, DoNotCountWhereTheWallClockSteppedInMidReceive) {
  for (const std::int64_t step_ms : {-86'400'000, -3'600'000, -40, -1, 1, 40, 3'600'000}) {
    EXPECT_EQ(StampAfter(Ahead(0), Ahead(step_ms)), At(300)) << "stamped before it";
    EXPECT_EQ(StampAfter(Ahead(0), Ahead(step_ms), 150 + step_ms), At(300)) << "and after it";
  }
}

// A burst is read in two batches behind the step. Both clocks run alike between the batches, but
// the frame came before the step.
TEST(FrameStamps, DoNotCountWhereTheWallClockSteppedAheadOfABatch) {
  g_ahead = {Ahead(0), Ahead(0), Ahead(40), Ahead(40)};
  FrameStamps stamps(ReadPlanned);
  stamps.HaveRead(At(100), At(101), /*empty=*/true);
  stamps.HaveRead(At(200), At(210), /*empty=*/false);
  stamps.HaveRead(At(210), At(220), /*empty=*/true);
  EXPECT_EQ(stamps.At(kAheadNs + 150'000'000, HostClock()), At(220));
}

// A frame comes after the socket was found empty. Then the wall clock steps, and only after that
// both clocks are read.
TEST(FrameStamps, DoNotCountWhereTheWallClockSteppedBeforeItWasRead) {
  g_ahead = {Ahead(0), Ahead(0), Ahead(40), Ahead(40)};
  FrameStamps stamps(ReadPlanned);
  stamps.HaveRead(At(100), At(101), /*empty=*/true);
  stamps.HaveRead(At(200), At(210), /*empty=*/true);
  stamps.HaveRead(At(300), At(310), /*empty=*/true);
  EXPECT_EQ(stamps.At(kAheadNs + 205'000'000 + 40'000'000, HostClock()), At(310));
}

TEST(FrameStamps, CountAgainOnceTheStepIsOver) {
  g_ahead = {Ahead(0), Ahead(0), Ahead(40), Ahead(40), Ahead(40)};
  FrameStamps stamps(ReadPlanned);
  for (const std::int64_t ms : {100, 200, 300, 400})
    stamps.HaveRead(At(ms), At(ms + 50), /*empty=*/true);
  EXPECT_EQ(stamps.At(kAheadNs + 380'000'000 + 40'000'000, HostClock()), At(380));
}

TEST(FrameStamps, DoNotCountOutsideOfWhatWasBetweenTheReadings) {
  EXPECT_EQ(StampAfter(Ahead(0), Ahead(0), 99), At(300));
  EXPECT_EQ(StampAfter(Ahead(0), Ahead(0), 301), At(300));
}

TEST(FrameStamps, AreNotTooEarlyWhereTheReaderWasHeldUpBetweenTheClocks) {
  EXPECT_EQ(StampAfter(Ahead(-30, 0), Ahead(0)), At(180));
  EXPECT_EQ(StampAfter(Ahead(0), Ahead(-30, 0)), At(180));
  EXPECT_EQ(StampAfter(Ahead(-1000, 0), Ahead(0)), At(300));
}

TEST(FrameStamps, OfWhatWasLeftBehindMayBeOlder) {
  g_ahead.assign(4, Ahead(0));
  FrameStamps stamps(ReadPlanned);
  stamps.HaveRead(At(100), At(110), /*empty=*/true);
  stamps.HaveRead(At(200), At(210), /*empty=*/false);
  stamps.HaveRead(At(210), At(220), /*empty=*/true);
  EXPECT_EQ(stamps.At(kAheadNs + 150'000'000, HostClock()), At(150));
}

/// Both ends of the pair have the kernel stamp what it takes in, as it does for CAN.
class StampedPair {
 public:
  StampedPair() {
    for (int& fd : fds_) {
      fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
      sockaddr_in any{};
      any.sin_family = AF_INET;
      any.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      EXPECT_EQ(::bind(fd, Address(&any), sizeof any), 0);
    }
    sockaddr_in address{};
    socklen_t length = sizeof address;
    EXPECT_EQ(::getsockname(fds_[1], Address(&address), &length), 0);
    EXPECT_EQ(::connect(fds_[0], Address(&address), length), 0);
    const int on = 1;
    EXPECT_EQ(::setsockopt(fds_[1], SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on), 0);
  }
  ~StampedPair() {
    for (const int fd : fds_) ::close(fd);
  }
  StampedPair(const StampedPair&) = delete;
  StampedPair& operator=(const StampedPair&) = delete;
  void Write(const CanFrame& frame) const {
    const can_frame raw = ToSocketFrame(frame);
    EXPECT_EQ(::send(fds_[0], &raw, sizeof raw, 0), static_cast<ssize_t>(sizeof raw));
  }
  [[nodiscard]] int b() const { return fds_[1]; }

 private:
  static sockaddr* Address(sockaddr_in* address) { return reinterpret_cast<sockaddr*>(address); }
  std::array<int, 2> fds_{-1, -1};
};

/// Returns one reading during which this process was not held up.
WallAhead ReadWell() {
  static const WallAhead well = [] {
    WallAhead ahead = ReadWallAhead();
    while (ahead.high_ns - ahead.low_ns > 100'000) ahead = ReadWallAhead();
    return ahead;
  }();
  return well;
}

WallAhead ReadStepped() {
  static std::int64_t stepped_ns = 0;
  const WallAhead ahead = ReadWallAhead();
  stepped_ns += 3'600'000'000'000;  // one hour between any two readings
  return {ahead.low_ns + stepped_ns, ahead.high_ns + stepped_ns};
}

TEST(SocketFrames, KernelStampsLieBetweenSendingAndReadingWhateverTheWallClockDoes) {
  const HostClock clock;
  for (WallAhead (*read)() : {ReadWell, ReadWallAhead, ReadStepped}) {
    const StampedPair pair;
    Aside aside;
    aside.stamps.emplace(read);
    std::vector<ReceivedFrame> received;
    PortCounters counters;
    // The kernel begins to stamp some time after the request.
    bool stamped = false;
    for (int i = 0; i < 3 || (read == ReadWell && !stamped && i < 10'000); ++i) {
      const HostInstant before = clock.Now();
      pair.Write({.id = 1, .length = 0, .data = {}});
      const HostInstant sent = clock.Now();
      while (clock.Now() < sent + Milliseconds(1)) continue;
      const HostInstant late = clock.Now();
      received.clear();
      ReceiveFrames(pair.b(), {.bus = {}, .clock = clock}, &received, &counters, &aside);
      ASSERT_EQ(received.size(), 1u);
      EXPECT_GE(received[0].at, before);
      EXPECT_LE(received[0].at, clock.Now());
      stamped = received[0].at < late;
    }
    EXPECT_TRUE(stamped || read != ReadWell);
  }
}

}  // namespace
}  // namespace focalfleet
