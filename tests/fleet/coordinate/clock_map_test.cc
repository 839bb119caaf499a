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
  Rng rng = Rng::Stream(test::TestSeed(11), "clock map");
  for (int run = 0; run < 2000; ++run) {
    TrueClock clock{1 + rng.Uniform(-0.015, 0.015), {Seconds(1).ns}, 0};
    if (run % 3 == 0) clock.first_ticks = 0xffff'fff0;  // wraps meanwhile
    ClockMap map;
    HostInstant now{Seconds(5).ns};
    for (int n = 0; n < 12; ++n) {
      now = now + Seconds(rng.Uniform(0.05, 20));
      ASSERT_TRUE(map.Observe(clock.Read(now, Delay(&rng, 5), Delay(&rng, 20))));
      ASSERT_EQ(map.readings(), std::min(static_cast<std::size_t>(n) + 1, ClockMap::kReadings));
      const ClockMap::Rate rate = map.rate();
      EXPECT_LE(std::abs(rate.error - (clock.rate - 1)), rate.bound + 1e-12);
      EXPECT_LE(rate.least, clock.rate - 1);
      EXPECT_GE(rate.most, clock.rate - 1);
      const HostInstant then = now - Seconds(rng.Uniform(0, 4));
      const ClockMap::Instant reported = map.TimeOf(clock.Ticks(then));
      EXPECT_LE(reported.earliest, then);
      EXPECT_GE(reported.latest, then);
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
  const ClockMap::Instant reported = map.TimeOf(clock.Ticks(then));
  EXPECT_LT(reported.bound(), Microseconds(500));
  EXPECT_LT(std::abs((reported.at - then).ns), Microseconds(150).ns);
}

TEST(ClockMap, OneReadingTellsNothingOfTheRate) {
  const TrueClock clock{1.01, {0}, 0};
  ClockMap map;
  EXPECT_EQ(map.rate().bound, ClockMap::kRateErrorMax);
  map.Observe(clock.Read({Seconds(3).ns}, Microseconds(100), Microseconds(100)));
  EXPECT_NEAR(map.rate().error, 0, 1e-12);
  EXPECT_NEAR(map.rate().bound, ClockMap::kRateErrorMax, 1e-12);
  // A second ago by a clock of which only so much is known.
  const ClockMap::Instant reported = map.TimeOf(clock.Ticks({Seconds(2).ns}));
  EXPECT_GT(reported.bound(), Milliseconds(15));
  EXPECT_LE(reported.earliest, HostInstant{Seconds(2).ns});
  EXPECT_GE(reported.latest, HostInstant{Seconds(2).ns});
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
  EXPECT_LE(map.TimeOf(clock.Ticks(then)).earliest, then);
  EXPECT_GE(map.TimeOf(clock.Ticks(then)).latest, then);
}

// A counter had hardly begun when it began anew: it lacks only what a slow clock would have lost.
TEST(ClockMap, ARestartOfAYoungUnitIsNotTakenForASlowClock) {
  Rng rng = Rng::Stream(test::TestSeed(12), "young units");
  for (int run = 0; run < 2000; ++run) {
    TrueClock clock{1 + rng.Uniform(-0.005, 0.005), {Seconds(1).ns}, 0};
    ClockMap map;
    HostInstant now = clock.powered + Seconds(rng.Uniform(0, 0.3));
    for (int n = 0; n < 6; ++n) {
      map.Observe(clock.Read(now, Delay(&rng, 1), Delay(&rng, 1)));
      ASSERT_FALSE(map.rate().IsBeyond(0.005)) << "run " << run << ", reading " << n;
      const HostInstant next = now + Seconds(rng.Uniform(0.5, 20));
      if (rng.Uniform() < 0.3) clock.powered = now + Seconds(rng.Uniform(0, 0.3));
      now = next;
    }
  }
}

TEST(ClockMap, BoundsThatContradictEachOtherAreNoReading) {
  const TrueClock clock{1.001, {0}, 0};
  ClockMap map;
  EXPECT_TRUE(map.Observe(clock.Read({Seconds(10).ns}, Milliseconds(1), Milliseconds(1))));
  const HostInstant then{Seconds(20).ns};
  EXPECT_FALSE(map.Observe({clock.Ticks(then), then, then - Microseconds(1)}));
  EXPECT_EQ(map.readings(), 1u);
  EXPECT_LT(map.TimeOf(clock.Ticks({Seconds(10).ns})).bound(), Microseconds(1200));
}

TEST(ClockMap, ReadingsThatContradictEachOtherSayNothingOfARate) {
  const TrueClock clock{1, {0}, 0};
  ClockMap map;
  for (int n = 1; n <= 4; ++n)
    map.Observe(clock.Read({Seconds(10 * n).ns}, Milliseconds(1), Milliseconds(1)));
  // The counter jumped: with the readings before it no rate fits.
  ClockMap::Reading reading = clock.Read({Seconds(50).ns}, Milliseconds(1), Milliseconds(1));
  reading.ticks += 3000;
  map.Observe(reading);
  EXPECT_EQ(map.readings(), 1u);
  EXPECT_FALSE(map.rate().IsBeyond(0.005));
}

// The readings may be as wide as any pauses make them.
TEST(ClockMap, AClockWithinItsLimitIsNeverCertainlyBeyondIt) {
  Rng rng = Rng::Stream(test::TestSeed(13), "pauses");
  for (int run = 0; run < 2000; ++run) {
    const double error = rng.Uniform(-0.005, 0.005);
    const TrueClock clock{1 + error, {0}, 0};
    ClockMap map;
    HostInstant now{Seconds(rng.Uniform(0.1, 100)).ns};
    for (int n = 0; n < 12; ++n) {
      now = now + Seconds(rng.Uniform(0.3, 12));
      map.Observe(clock.Read(now, Delay(&rng, rng.Uniform() < 0.3 ? 8000 : 3),
                             Delay(&rng, rng.Uniform() < 0.3 ? 8000 : 3)));
      ASSERT_FALSE(map.rate().IsBeyond(0.005)) << "run " << run << ", reading " << n;
    }
  }
}

TEST(ClockMap, AClockOnePercentOffIsKnownToBeByItsSecondGoodReading) {
  for (const double error : {0.01, -0.01}) {
    const TrueClock clock{1 + error, {0}, 0};
    ClockMap map;
    map.Observe(clock.Read({Seconds(60).ns}, Milliseconds(10), Milliseconds(10)));
    EXPECT_FALSE(map.rate().IsBeyond(0.005));
    map.Observe(clock.Read({Seconds(70).ns}, Milliseconds(10), Milliseconds(10)));
    EXPECT_TRUE(map.rate().IsBeyond(0.005));
  }
}

// Wide readings between them neither hide the rate nor are needed.
TEST(ClockMap, WideReadingsBetweenGoodOnesDoNotHideAClockThatIsOff) {
  const TrueClock clock{1.01, {0}, 0};
  ClockMap map;
  for (int n = 0; n < 8; ++n) {
    const DurationNs wide = n == 2 || n == 6 ? Milliseconds(5) : Milliseconds(4000);
    map.Observe(clock.Read({Seconds(60 + 10 * n).ns}, wide, wide));
    EXPECT_EQ(map.rate().IsBeyond(0.005), n >= 6) << n;
  }
}

TEST(ClockMap, AClockBeyondAllThatIsUsualIsKnownAsWell) {
  for (const double error : {0.03, -0.05, 0.2}) {
    const TrueClock clock{1 + error, {0}, 0};
    ClockMap map;
    for (int n = 0; n < 3; ++n)
      map.Observe(clock.Read({Seconds(100 + 10 * n).ns}, Milliseconds(1), Milliseconds(1)));
    EXPECT_EQ(map.readings(), 3u);
    EXPECT_NEAR(map.rate().error, error, 1e-3);
    EXPECT_LE(map.rate().least, error);
    EXPECT_GE(map.rate().most, error);
    EXPECT_TRUE(map.rate().IsBeyond(0.02));
    const HostInstant then{Seconds(115).ns};
    EXPECT_LE(map.TimeOf(clock.Ticks(then)).earliest, then);
    EXPECT_GE(map.TimeOf(clock.Ticks(then)).latest, then);
  }
}

}  // namespace
}  // namespace focalfleet
