// The load of a harness is compared with Kirchhoff's laws, segment by segment.
#include "sim/campaigns/effects/harness.h"

#include <gtest/gtest.h>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

struct Drawn {
  Exposures exposures;
  std::vector<double> step_deg[2];
  std::vector<double> rail, slot, movers;
};

// Units on rails in any order, in several exposures; some move one axis, some both, some none.
Drawn Draw(Rng* rng) {
  constexpr std::size_t kExposures = 4, kUnits = 15;
  Drawn drawn;
  drawn.exposures.move_id.assign(kExposures, 0);
  std::vector<double> seen(kExposures * 3);
  for (std::size_t unit = 0; unit < kUnits; ++unit)
    for (std::size_t e = 0; e < kExposures; ++e) {
      drawn.exposures.of_row.push_back(static_cast<std::uint32_t>(e));
      drawn.rail.push_back(static_cast<double>(unit % 3));
      drawn.slot.push_back(static_cast<double>((unit * 7) % kUnits / 3));
      for (auto& step : drawn.step_deg) step.push_back(rng->Uniform() < 0.6 ? 5 : 0);
      if (drawn.step_deg[0].back() != 0 || drawn.step_deg[1].back() != 0)
        seen[e * 3 + unit % 3] += 1;
    }
  for (std::size_t row = 0; row < drawn.rail.size(); ++row)
    drawn.movers.push_back(
        seen[drawn.exposures.of_row[row] * 3 + static_cast<std::size_t>(drawn.rail[row])]);
  return drawn;
}

double MotorsAt(const Drawn& drawn, std::size_t row) {
  return (drawn.step_deg[0][row] != 0 ? 1 : 0) + (drawn.step_deg[1][row] != 0 ? 1 : 0);
}

// Segment k is the one before slot k: it carries the current of all motors at k and behind.
double DropBySegments(const Drawn& drawn, std::size_t of) {
  double drop = 0;
  for (double segment = 0; segment <= drawn.slot[of]; segment += 1)
    for (std::size_t row = 0; row < drawn.rail.size(); ++row)
      if (drawn.rail[row] == drawn.rail[of] && drawn.slot[row] >= segment &&
          drawn.exposures.of_row[row] == drawn.exposures.of_row[of])
        drop += MotorsAt(drawn, row);
  return drop;
}

TEST(Harness, EachSegmentCarriesTheCurrentOfAllBehindIt) {
  const std::uint64_t seed = testing::TestSeed(60);
  SCOPED_TRACE(seed);
  Rng rng = Rng::Stream(seed, "harness");
  for (int round = 0; round < 20; ++round) {
    Drawn drawn = Draw(&rng);
    const HarnessLoads loads =
        FindHarnessLoads(drawn.exposures, drawn.step_deg, drawn.rail, drawn.slot, drawn.movers);
    constexpr double kSlots = 5;
    for (std::size_t row = 0; row < drawn.rail.size(); ++row)
      EXPECT_NEAR(loads.shared_motors[row] * kSlots, DropBySegments(drawn, row), 1e-9);
    // Twice as many movers as rows: those that the table does not have move as the others do.
    for (double& movers : drawn.movers) movers *= 2;
    const HarnessLoads twice =
        FindHarnessLoads(drawn.exposures, drawn.step_deg, drawn.rail, drawn.slot, drawn.movers);
    for (std::size_t row = 0; row < drawn.rail.size(); ++row) {
      EXPECT_NEAR(twice.motors[row], 2 * loads.motors[row], 1e-9);
      EXPECT_NEAR(twice.shared_motors[row], 2 * loads.shared_motors[row], 1e-9);
    }
  }
}

TEST(Harness, WithoutSlotsTheFeedAloneIsKnown) {
  Rng rng = Rng::Stream(61, "harness");
  const Drawn drawn = Draw(&rng);
  const HarnessLoads loads =
      FindHarnessLoads(drawn.exposures, drawn.step_deg, drawn.rail, {}, drawn.movers);
  EXPECT_TRUE(loads.shared_motors.empty());
  for (std::size_t row = 0; row < drawn.rail.size(); ++row) {
    double motors = 0;
    for (std::size_t other = 0; other < drawn.rail.size(); ++other)
      if (drawn.rail[other] == drawn.rail[row] &&
          drawn.exposures.of_row[other] == drawn.exposures.of_row[row])
        motors += MotorsAt(drawn, other);
    EXPECT_EQ(loads.motors[row], motors);
  }
}

}  // namespace
}  // namespace focalfleet::sim
