#include "daemon/ports/transmit_window.h"

#include <gtest/gtest.h>

#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

constexpr HostInstant kNow{1'000'000};
const CanFrame kFrame{.id = 5u << 26, .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};

TEST(TransmitWindow, ConfirmationsMakeRoomOneByOne) {
  TransmitWindow window({.confirms = true});
  EXPECT_EQ(window.Room(false, kNow), 2u);
  window.Sent(kFrame, kNow);
  window.Sent(kFrame, kNow);
  EXPECT_EQ(window.Room(false, kNow), 0u);
  EXPECT_EQ(window.Room(true, kNow), 1u) << "the third place is a stop's";
  window.Sent(kFrame, kNow);
  EXPECT_EQ(window.Room(true, kNow), 0u);
  window.Confirmed(1);
  EXPECT_EQ(window.Room(false, kNow), 0u) << "two are below still";
  window.Confirmed(1);
  EXPECT_EQ(window.Room(false, kNow), 1u);
  window.Confirmed(7);
  EXPECT_EQ(window.Room(false, kNow), 2u) << "more than were sent means none is left";
  EXPECT_EQ(window.RoomAt(), kNever);
}

TEST(TransmitWindow, LearnsWhatTheKernelChargesFromOneFrameAlone) {
  TransmitWindow window;
  window.Charged(0);
  EXPECT_EQ(window.Room(false, kNow), 2u);
  window.Sent(kFrame, kNow);
  window.Sent(kFrame, kNow);
  window.Charged(1536);
  EXPECT_EQ(window.Room(false, kNow), 0u);
  EXPECT_EQ(window.Room(true, kNow), 1u) << "no more than went down";
  window.Charged(768);
  EXPECT_EQ(window.Room(false, kNow), 0u) << "may still be both";
  window.Charged(0);
  EXPECT_EQ(window.Room(false, kNow), 1u) << "one alone, to learn";
  window.Sent(kFrame, kNow);
  window.Charged(768);
  EXPECT_EQ(window.Room(false, kNow), 1u);
  window.Sent(kFrame, kNow);
  window.Charged(1536);
  EXPECT_EQ(window.Room(false, kNow), 0u);
  EXPECT_EQ(window.Room(true, kNow), 1u);
  window.Charged(1537);
  EXPECT_EQ(window.Room(true, kNow), 0u) << "part of a third is a third";
}

TEST(TransmitWindow, AnInterfaceThatHoldsNothingIsNeverFull) {
  TransmitWindow window;
  for (const std::size_t room : {2u, 4u, 8u, 16u, 32u, 64u, 64u}) {
    window.Charged(0);
    ASSERT_EQ(window.Room(false, kNow), room);
    for (std::size_t i = 0; i < room; ++i) window.Sent(kFrame, kNow);
  }
  // A queue is put in between.
  window.Charged(768 * 64);
  EXPECT_EQ(window.Room(true, kNow), 0u);
  window.Charged(0);
  EXPECT_EQ(window.Room(false, kNow), 1u) << "as any other from now on";
}

TEST(TransmitWindow, TheBitClockHoldsAFrameForItsBits) {
  TransmitWindow window({.bit_rate_bps = 1'000'000});
  const DurationNs took = Microseconds(FrameBits(kFrame));
  window.Sent(kFrame, kNow);
  window.Sent(kFrame, kNow);
  EXPECT_EQ(window.Room(false, kNow), 0u);
  EXPECT_EQ(window.RoomAt(), kNow + took);
  EXPECT_EQ(window.Room(false, kNow + took - DurationNs{1}), 0u);
  EXPECT_EQ(window.Room(false, kNow + took), 1u);
  EXPECT_EQ(window.Room(false, kNow + took * 2), 2u);
  // The wire was idle, so the bit clock begins anew.
  window.Sent(kFrame, kNow + took * 10);
  window.Sent(kFrame, kNow + took * 10);
  EXPECT_EQ(window.RoomAt(), kNow + took * 11);
}

TEST(TransmitWindow, TheBitClockNeedsNotLearnWhatTheKernelCharges) {
  TransmitWindow window({.bit_rate_bps = 1'000'000});
  const DurationNs took = Microseconds(FrameBits(kFrame));
  window.Sent(kFrame, kNow);
  window.Sent(kFrame, kNow);
  window.Charged(1536);
  EXPECT_EQ(window.Room(true, kNow), 1u);
  EXPECT_EQ(window.Room(false, kNow + took * 2), 0u) << "the driver is slower than the wire";
  window.Charged(0);
  EXPECT_EQ(window.Room(false, kNow + took * 2), 2u);
}

TEST(TransmitWindow, AFrameOfAnotherNodeDelaysOursThatWaited) {
  TransmitWindow window({.bit_rate_bps = 1'000'000});
  const DurationNs took = Microseconds(FrameBits(kFrame));
  window.Sent(kFrame, kNow);
  window.Sent(kFrame, kNow);
  // The foreign frame won the wire after our first, and ended when our second would have ended.
  window.Heard(kFrame, kNow + took * 2);
  EXPECT_EQ(window.Room(false, kNow + took), 1u) << "the first left before";
  EXPECT_EQ(window.Room(false, kNow + took * 3 - DurationNs{1}), 1u);
  EXPECT_EQ(window.Room(false, kNow + took * 3), 2u);
}

TEST(TransmitWindow, AGroupIsOneFrameThatTakesItsTimeAtBothRates) {
  constexpr BusRates kRates{1'000'000, 4'000'000};
  TransmitWindow window({.bit_rate_bps = kRates.nominal_bps, .data_bit_rate_bps = kRates.data_bps});
  FdFrame group{.id = kGroupId, .length = 64, .data = {}};
  window.Sent(group, kNow);
  EXPECT_EQ(window.Room(false, kNow), 1u);
  const HostInstant first = kNow + BitTime(FrameBits(group), kRates);
  window.Sent(kFrame, kNow);
  EXPECT_EQ(window.RoomAt(), first);
  EXPECT_EQ(window.Room(false, first - DurationNs{1}), 0u);
  EXPECT_EQ(window.Room(false, first), 1u);
  window.Sent(group, first);
  EXPECT_EQ(window.RoomAt(), first + BitTime(FrameBits(kFrame), kRates.nominal_bps));
}

}  // namespace
}  // namespace focalfleet
