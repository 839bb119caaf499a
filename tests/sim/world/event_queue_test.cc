#include "sim/world/event_queue.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

TEST(EventQueue, AlwaysShowsTheSoonestAndTheLowestSlotOfEqualOnes) {
  const std::uint64_t seed = focalfleet::test::TestSeed(6);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const std::size_t slots : {1u, 2u, 7u, 100u}) {
    EventQueue queue(slots);
    std::vector<HostInstant> plain(slots, kNever);
    for (int i = 0; i < 5000; ++i) {
      const std::size_t slot = rng.Below(slots);
      plain[slot] =
          rng.Below(5) == 0 ? kNever : HostInstant{static_cast<std::int64_t>(rng.Below(20))};
      queue.Set(slot, plain[slot]);
      const auto soonest = std::min_element(plain.begin(), plain.end());
      ASSERT_EQ(queue.next(), *soonest);
      ASSERT_EQ(queue.slot(), static_cast<std::size_t>(soonest - plain.begin()));
    }
  }
}

TEST(EventQueue, OfNothingIsNever) { EXPECT_EQ(EventQueue(0).next(), kNever); }

}  // namespace
}  // namespace focalfleet::sim
