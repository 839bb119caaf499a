// Whole focal planes: 5000 units of a hexagonal fleet and the measured plate of DESI, random
// configuration to random configuration. Every unit must be served, and the independent checker
// must find no pair that is not clear. Each test has a seed or a few, so that ctest spreads them;
// FOCALFLEET_SEED picks one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>

#include "fleet/files/layout_file.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::HexFleet;
using test::PlanningFleet;
using test::TestSeed;

/// Returns the makespan over the time of the slowest unit alone.
double ExpectAllServed(PlanningFleet* fleet, std::uint64_t seed, double unnoticed_most = 0.02) {
  FOCALFLEET_TRACE_SEED(seed);
  DrawStartAndTargets(fleet, seed);
  const std::clock_t begin = std::clock();
  const auto plan = MakePlan(fleet->request(), {});
  const double cpu_s = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  if (!plan) {
    ADD_FAILURE() << plan.error().text;
    return 1e9;
  }
  // A unit that is not served has no way at all: next to disabled units that happens.
  for (const Unserved& unserved : plan->unserved)
    EXPECT_TRUE(unserved.proof) << "unit index " << unserved.unit.value;
  const double ratio = plan->makespan_s / plan->bound_s;
  // In a plan all at once few of the pairs that cross may be noticed too late; an order has no
  // notice.
  if (ratio < 1.25) {
    EXPECT_LE(static_cast<double>(plan->unnoticed.size()), unnoticed_most * plan->crossings);
  }
  ExpectSound(*fleet, *plan);
  std::printf("FOCALFLEET_SEED=%llu moves %zu unserved %zu makespan %.2f of %.2f s cpu %.2f s\n",
              static_cast<unsigned long long>(seed), plan->moves.size(), plan->unserved.size(),
              plan->makespan_s, plan->bound_s, cpu_s);
  return ratio;
}

constexpr std::uint64_t kSeedsPerTest = 5;

void ExpectCloseToTheBound(PlanningFleet* fleet, std::uint64_t first, double worst) {
  std::vector<double> ratios;
  for (std::uint64_t k = 0; k < kSeedsPerTest; ++k)
    ratios.push_back(ExpectAllServed(fleet, TestSeed(1 + first + k)));
  std::sort(ratios.begin(), ratios.end());
  EXPECT_LE(ratios[kSeedsPerTest / 2], 1.05);
  EXPECT_LE(ratios.back(), worst);
}

class HexScale : public ::testing::TestWithParam<int> {};

TEST_P(HexScale, Serves5000UnitsFromRandomToRandom) {
  PlanningFleet fleet = HexFleet(5000);
  const std::uint64_t first = static_cast<std::uint64_t>(GetParam()) * kSeedsPerTest;
  ExpectCloseToTheBound(&fleet, first, 1.25);
}
INSTANTIATE_TEST_SUITE_P(Seeds, HexScale, ::testing::Range(0, 4));

TEST(DenseScale, ServesPlatesLikeThoseOfSdss) {
  // Arms that reach over their neighbours' bases stand in each other's way far more often.
  constexpr double kUnnoticedMost = 0.2;
  constexpr double kRatioMost = 1.8;
  PlanningFleet small = FleetOf(MakeHexLayout(SdssLike(500)));
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    EXPECT_LE(ExpectAllServed(&small, TestSeed(seed), kUnnoticedMost), kRatioMost);
  PlanningFleet large = FleetOf(MakeHexLayout(SdssLike(5000)));
  EXPECT_LE(ExpectAllServed(&large, TestSeed(7), kUnnoticedMost), kRatioMost);
}

#ifdef FOCALFLEET_DESI_UNITS
class DesiScale : public ::testing::TestWithParam<int> {};

TEST_P(DesiScale, ServesAllEnabledUnitsOfTheRealPlate) {
  std::ifstream file(FOCALFLEET_DESI_UNITS);
  std::stringstream text;
  text << file.rdbuf();
  auto read = ReadUnits(text.str(), FOCALFLEET_DESI_UNITS);
  ASSERT_TRUE(read) << read.error().text;
  PlanningFleet fleet = FleetOf(std::move(read->units));
  ASSERT_EQ(fleet.layout.size(), 5020u);
  const std::uint64_t first = static_cast<std::uint64_t>(GetParam()) * kSeedsPerTest;
  ExpectCloseToTheBound(&fleet, first, 1.4);
}
INSTANTIATE_TEST_SUITE_P(Seeds, DesiScale, ::testing::Range(0, 2));
#endif

}  // namespace
}  // namespace focalfleet
