#include "sim/world/bus/error_counters.h"

#include <gtest/gtest.h>

namespace focalfleet::sim {
namespace {

TEST(ErrorCounters, SixteenTransmitErrorsMakePassiveAndThirtyTwoOff) {
  ErrorCounters counters;
  for (int i = 1; i <= 32; ++i) {
    counters.TransmitError();
    EXPECT_EQ(counters.warns(), i >= 12) << i;
    EXPECT_EQ(counters.state(), i < 16   ? Confinement::kActive
                                : i < 32 ? Confinement::kPassive
                                         : Confinement::kOff)
        << i;
  }
  counters.Recover();
  EXPECT_TRUE(counters.clean());
  EXPECT_EQ(counters.state(), Confinement::kActive);
}

TEST(ErrorCounters, ReceiveErrorsAloneNeverTurnOff) {
  ErrorCounters counters;
  for (int i = 0; i < 1000; ++i) counters.ReceiveError();
  EXPECT_EQ(counters.state(), Confinement::kPassive);
  counters.Received();
  EXPECT_GE(counters.receive(), 119u);
  EXPECT_LE(counters.receive(), 127u);
  EXPECT_EQ(counters.state(), Confinement::kActive);
}

TEST(ErrorCounters, EightGoodFramesMakeUpForOneTransmitError) {
  ErrorCounters counters;
  counters.TransmitError();
  for (int i = 0; i < 7; ++i) counters.Transmitted();
  EXPECT_FALSE(counters.clean());
  counters.Transmitted();
  counters.Transmitted();
  counters.Received();
  EXPECT_TRUE(counters.clean());
}

}  // namespace
}  // namespace focalfleet::sim
