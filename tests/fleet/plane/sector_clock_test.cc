#include "fleet/plane/sector_clock.h"

#include <gtest/gtest.h>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

HostInstant At(double s) { return HostInstant{0} + Seconds(s); }

TEST(SectorClock, KnowsNothingWithoutASample) { EXPECT_FALSE(SectorClock().At(At(1)).has_value()); }

TEST(SectorClock, BoundsTheTrueOffsetWhateverTheDelays) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng = Rng::Stream(seed, "clock");
    const double ahead_s = rng.Uniform(-1000, 1000);
    const double drift = rng.Uniform(-50e-6, 50e-6);
    const auto of_sector = [&](double s) { return At(s + ahead_s + drift * s); };
    SectorClock clock;
    double now_s = 10;
    for (int n = 0; n < 100; ++n) {
      const double sent_s = now_s;
      const double received_s = sent_s + rng.Uniform(0, 0.05);
      const double returned_s = received_s + rng.Uniform(0, 0.3);
      now_s = returned_s + rng.Uniform(0, 0.05);
      clock.Add({At(sent_s), of_sector(received_s), of_sector(returned_s), At(now_s)});
      now_s += rng.Uniform(0, 1);
      const auto offset = clock.At(At(now_s));
      ASSERT_TRUE(offset.has_value());
      const DurationNs true_ahead = of_sector(now_s) - At(now_s);
      EXPECT_LE(offset->ahead.ns - offset->bound.ns, true_ahead.ns + 1000) << n;
      EXPECT_GE(offset->ahead.ns + offset->bound.ns, true_ahead.ns - 1000) << n;
    }
  }
}

TEST(SectorClock, PrefersTheQuickestExchange) {
  SectorClock clock;
  clock.Add({At(1), At(1.010), At(1.010), At(1.020)});
  clock.Add({At(2), At(2.001), At(2.001), At(2.002)});
  clock.Add({At(3), At(3.050), At(3.050), At(3.100)});
  const auto offset = clock.At(At(3.1));
  ASSERT_TRUE(offset.has_value());
  EXPECT_LT(offset->bound, Milliseconds(2));
}

TEST(SectorClock, TrustsAnOldSampleLess) {
  SectorClock clock;
  clock.Add({At(1), At(1.001), At(1.001), At(1.002)});
  EXPECT_GT(clock.At(At(101))->bound, clock.At(At(2))->bound + Milliseconds(9));
}

TEST(SectorClock, PassesOverASampleThatContradictsItself) {
  SectorClock clock;
  clock.Add({At(2), At(1), At(5), At(2.1)});
  EXPECT_FALSE(clock.At(At(3)).has_value());
}

}  // namespace
}  // namespace focalfleet
