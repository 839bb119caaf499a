#include "fleet/coordinate/clock_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

/// A clock of known rate, and delays of a bus and a host around each reading of it.
struct TrueClock {
  double rate = 1;
  HostInstant powered{0};
  std::uint64_t first_ticks = 0;

  [[nodiscard]] std::uint32_t Ticks(HostInstant at) const {
    const double unit_ns = static_cast<double>((at - powered).ns) * rate;
    return static_cast<std::uint32_t>(first_ticks + static_cast<std::uint64_t>(unit_ns / 100'000));
  }
  [[nodiscard]] ClockMap::Reading Read(HostInstant at, DurationNs before, DurationNs after) const {
    return {Ticks(at), at - before, at + after};
  }
};

DurationNs Delay(Rng* rng, double most_ms) { return Seconds(rng->Uniform(0, most_ms * 1e-3)); }

TEST(ClockMap, TruthIsAlwaysWithinTheBounds) {
  Rng rng = Rng::Stream(testing::TestSeed(11), "clock map");
  for (int run = 0; run < 2000; ++run) {
    TrueClock clock{1 + rng.Uniform(-0.015, 0.015), {Seconds(1).ns}, 0};
    if (run % 3 == 0) clock.first_ticks = 0xffff'fff0;  // wraps meanwhile
    ClockMap map;
    HostInstant now{Seconds(5).ns};
    for (int n = 0; n < 12; ++n) {
      now = now + Seconds(rng.Uniform(0.05, 20));
      map.Observe(clock.Read(now, Delay(&rng, 5), Delay(&rng, 20)));
      ASSERT_EQ(map.readings(), std::min(static_cast<std::size_t>(n) + 1, ClockMap::kReadings));
      const ClockMap::Rate rate = map.rate();
      EXPECT_LE(std::abs(rate.error - (clock.rate - 1)), rate.bound + 1e-12);
      const HostInstant then = now - Seconds(rng.Uniform(0, 4));
      const ClockMap::Instant told = map.TimeOf(clock.Ticks(then));
      EXPECT_LE(told.earliest(), then);
      EXPECT_GE(told.latest(), then);
    }
  }
}

TEST(ClockMap, ComesToKnowTheRateAndTheTimeWell) {
  const TrueClock clock{1.0031, {0}, 0};
  ClockMap map;
  for (int n = 0; n < 8; ++n)
    map.Observe(clock.Read({Seconds(10 + 10 * n).ns}, Microseconds(200), Microseconds(150)));
  EXPECT_NEAR(map.rate().error, 0.0031, 3e-6);
  EXPECT_LT(map.rate().bound, 50e-6);
  const HostInstant then{Seconds(79).ns};
  const ClockMap::Instant told = map.TimeOf(clock.Ticks(then));
  EXPECT_LT(told.bound, Microseconds(500));
  EXPECT_LT(std::abs((told.at - then).ns), Microseconds(150).ns);
}

TEST(ClockMap, OneReadingTellsNothingOfTheRate) {
  const TrueClock clock{1.01, {0}, 0};
  ClockMap map;
  EXPECT_EQ(map.rate().bound, ClockMap::kRateErrorMax);
  map.Observe(clock.Read({Seconds(3).ns}, Microseconds(100), Microseconds(100)));
  EXPECT_NEAR(map.rate().error, 0, 1e-12);
  EXPECT_NEAR(map.rate().bound, ClockMap::kRateErrorMax, 1e-12);
  // A second ago by a clock of which only so much is known.
  const ClockMap::Instant told = map.TimeOf(clock.Ticks({Seconds(2).ns}));
  EXPECT_GT(told.bound, Milliseconds(15));
  EXPECT_LE(told.earliest(), HostInstant{Seconds(2).ns});
  EXPECT_GE(told.latest(), HostInstant{Seconds(2).ns});
}

TEST(ClockMap, ARestartedUnitHasAnotherClock) {
  TrueClock clock{0.998, {0}, 0};
  ClockMap map;
  for (int n = 1; n <= 4; ++n)
    map.Observe(clock.Read({Seconds(10 * n).ns}, Milliseconds(1), Milliseconds(1)));
  EXPECT_EQ(map.readings(), 4u);
  clock.powered = {Seconds(45).ns};
  map.Observe(clock.Read({Seconds(50).ns}, Milliseconds(1), Milliseconds(1)));
  EXPECT_EQ(map.readings(), 1u);
  const HostInstant then{Seconds(48).ns};
  EXPECT_LE(map.TimeOf(clock.Ticks(then)).earliest(), then);
  EXPECT_GE(map.TimeOf(clock.Ticks(then)).latest(), then);
}

}  // namespace
}  // namespace focalfleet
