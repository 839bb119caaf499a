#include "daemon/loop/transmit_queue.h"

#include <gtest/gtest.h>

#include <variant>

#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

/// A port that takes a number of frames, and no more until it gets room again.
class NarrowPort : public FramePort {
 public:
  explicit NarrowPort(std::size_t room) : room_(room) {}
  std::size_t Send(std::span<const CanFrame> frames) override {
    const std::size_t taken = std::min(room_, frames.size());
    sent.insert(sent.end(), frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(taken));
    room_ -= taken;
    return taken;
  }
  void Receive(HostInstant, std::vector<ReceivedFrame>*) override {}
  [[nodiscard]] LinkState state() const override { return LinkState::kUp; }
  void GiveRoom(std::size_t room) { room_ = room; }

  std::vector<CanFrame> sent;

 private:
  std::size_t room_;
};

constexpr HostInstant kNow{1'000'000'000};

CanFrame Identify(std::uint8_t node) {
  return Encode(HostMessage(IdentifyRequest{}), {NodeId{node}, 1});
}
const CanFrame kStop = Encode(HostMessage(Stop{}), {kBroadcastNode, 0});
CanFrame StartIn(std::uint32_t ticks) {
  return Encode(HostMessage(Start{.move = MoveId{5}, .delay_ticks = ticks}), {kBroadcastNode, 3});
}
std::uint32_t DelayOf(const CanFrame& frame) {
  const auto decoded = DecodeHost(frame);
  const auto* start = decoded ? std::get_if<Start>(&decoded->message) : nullptr;
  return start == nullptr ? 0 : start->delay_ticks;
}

TEST(TransmitQueue, SendsInOrderAndKeepsFramesThatThePortRefuses) {
  TransmitQueue transmit_queue;
  NarrowPort port(70);
  for (std::uint8_t n = 0; n < 100; ++n) EXPECT_TRUE(transmit_queue.Put(Identify(n), kNow));
  transmit_queue.Flush(&port, kNow);
  EXPECT_EQ(port.sent.size(), 70u);
  EXPECT_EQ(transmit_queue.size(), 30u);
  port.GiveRoom(1000);
  transmit_queue.Flush(&port, kNow);
  ASSERT_EQ(port.sent.size(), 100u);
  for (std::uint8_t n = 0; n < 100; ++n) EXPECT_EQ(port.sent[n], Identify(n));
}

TEST(TransmitQueue, StopPassesEverythingThatWaits) {
  TransmitQueue transmit_queue;
  NarrowPort port(0);
  for (std::uint8_t n = 0; n < 10; ++n) transmit_queue.Put(Identify(n), kNow);
  transmit_queue.Flush(&port, kNow);
  transmit_queue.Put(kStop, kNow);
  port.GiveRoom(1);
  transmit_queue.Flush(&port, kNow);
  ASSERT_EQ(port.sent.size(), 1u);
  EXPECT_EQ(port.sent[0], kStop);
}

TEST(TransmitQueue, AFullOneStillTakesAStop) {
  TransmitQueue transmit_queue(3);
  for (std::uint8_t n = 0; n < 3; ++n) EXPECT_TRUE(transmit_queue.Put(Identify(n), kNow));
  EXPECT_FALSE(transmit_queue.Put(Identify(3), kNow));
  EXPECT_EQ(transmit_queue.counters().refused, 1u);
  EXPECT_TRUE(transmit_queue.Put(kStop, kNow));
  EXPECT_EQ(transmit_queue.size(), 4u);
}

TEST(TransmitQueue, TheTimeThatAStartWaitedIsTakenOffItsDelay) {
  TransmitQueue transmit_queue;
  NarrowPort port(100);
  transmit_queue.Put(StartIn(2500), kNow);
  transmit_queue.Flush(&port, kNow + Milliseconds(7));
  ASSERT_EQ(port.sent.size(), 1u);
  EXPECT_EQ(DelayOf(port.sent[0]), 2500u - 70u);
  transmit_queue.Put(StartIn(2500), kNow);
  transmit_queue.Flush(&port, kNow + Microseconds(20));
  EXPECT_EQ(port.sent[1], StartIn(2500)) << "less than half a tick is none";
}

TEST(TransmitQueue, AStartThatMissedItsInstantIsNotSent) {
  TransmitQueue transmit_queue;
  NarrowPort port(100);
  transmit_queue.Put(Identify(1), kNow);
  transmit_queue.Put(StartIn(100), kNow);
  transmit_queue.Put(Identify(2), kNow);
  transmit_queue.Flush(&port, kNow + Milliseconds(10));
  ASSERT_EQ(port.sent.size(), 2u);
  EXPECT_EQ(port.sent[0], Identify(1));
  EXPECT_EQ(port.sent[1], Identify(2));
  EXPECT_EQ(transmit_queue.counters().late_starts, 1u);
}

TEST(TransmitQueue, AfterTheLinkWasDownNothingOldIsSent) {
  TransmitQueue transmit_queue;
  NarrowPort port(0);
  transmit_queue.Put(Identify(1), kNow);
  transmit_queue.Put(kStop, kNow);
  transmit_queue.Clear();
  port.GiveRoom(10);
  transmit_queue.Flush(&port, kNow);
  EXPECT_TRUE(port.sent.empty());
  EXPECT_EQ(transmit_queue.counters().stale, 2u);
}

}  // namespace
}  // namespace focalfleet
