#include "fleet/coordinate/play.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

TEST(AxisPlay, IsKnownAfterAWayThroughAllOfIt) {
  AxisPlay play;
  EXPECT_EQ(play.side(), 0);
  play.Go(-0.9);
  EXPECT_EQ(play.side(), 0);
  play.Go(-0.1);
  EXPECT_EQ(play.side(), -1);
  EXPECT_EQ(play.SideAfter(-3), -1);
  EXPECT_EQ(play.SideAfter(0.5), 0);
  EXPECT_EQ(play.SideAfter(1), 1);
  EXPECT_EQ(play.side(), -1);  // looking ahead changes nothing
}

TEST(AxisPlay, IsLostByASmallWayBackAndFoundByTheSameWayAgain) {
  AxisPlay play;
  play.Go(-1);
  play.Go(0.3);
  EXPECT_EQ(play.side(), 0);
  play.Go(-0.1);
  EXPECT_EQ(play.side(), 0);  // the last way went down, and not far enough
  play.Go(-0.2);
  EXPECT_EQ(play.side(), -1);
  play.Forget();
  EXPECT_EQ(play.side(), 0);
}

TEST(AxisPlay, NeverNamesASideOnWhichANarrowerPlayIsNot) {
  const std::uint64_t seed = focalfleet::test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int named = 0;
  for (int k = 0; k < 2000; ++k) {
    const double width = rng.Uniform(0.1, 1);
    double stands = rng.Uniform(0, width);
    AxisPlay play;
    for (int way = 0; way < 20; ++way) {
      const double ways = rng.Uniform(-1.2, 1.2);
      play.Go(ways);
      stands = std::clamp(stands + ways, 0.0, width);
      if (play.side() == 0) continue;
      ++named;
      EXPECT_DOUBLE_EQ(stands, play.side() < 0 ? 0 : width);
    }
  }
  EXPECT_GT(named, 2000);
}

}  // namespace
}  // namespace focalfleet
