// Whole focal planes: 5000 units of a hexagonal fleet and the measured plate of DESI, random
// configuration to random configuration. Every unit must be served, and the independent checker
// must find no pair that is not clear. One test a seed or a few, so that ctest spreads them;
// FOCALFLEET_SEED picks one.
#include <gtest/gtest.h>

#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>

#include "fleet/files/layout_file.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet::testing {
namespace {

void ExpectAllServed(PlanningFleet* fleet, std::uint64_t seed, double ratio_most) {
  FOCALFLEET_TRACE_SEED(seed);
  ASSERT_NO_FATAL_FAILURE(DrawStartAndTargets(fleet, seed));
  const std::clock_t begin = std::clock();
  const auto plan = MakePlan(fleet->request(), {});
  const double cpu_s = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty()) << plan->unserved.size() << " units";
  EXPECT_LE(plan->makespan_s, ratio_most * plan->bound_s);
  // Of the pairs that cross hardly any may be noticed too late.
  EXPECT_LE(static_cast<double>(plan->unnoticed.size()), 0.02 * plan->crossings);
  ExpectSound(*fleet, *plan);
  std::printf("FOCALFLEET_SEED=%llu moves %zu unserved %zu makespan %.2f of %.2f s cpu %.2f s\n",
              static_cast<unsigned long long>(seed), plan->moves.size(), plan->unserved.size(),
              plan->makespan_s, plan->bound_s, cpu_s);
}

constexpr std::uint64_t kSeedsPerTest = 5;

class HexScale : public ::testing::TestWithParam<int> {};

TEST_P(HexScale, Serves5000UnitsFromRandomToRandom) {
  PlanningFleet fleet = HexFleet(5000);
  const std::uint64_t first = static_cast<std::uint64_t>(GetParam()) * kSeedsPerTest;
  for (std::uint64_t k = 0; k < kSeedsPerTest; ++k)
    ExpectAllServed(&fleet, TestSeed(1 + first + k), 1.25);
}
INSTANTIATE_TEST_SUITE_P(Seeds, HexScale, ::testing::Range(0, 4));

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
  for (std::uint64_t k = 0; k < kSeedsPerTest; ++k)
    ExpectAllServed(&fleet, TestSeed(1 + first + k), 1.4);
}
INSTANTIATE_TEST_SUITE_P(Seeds, DesiScale, ::testing::Range(0, 2));
#endif

}  // namespace
}  // namespace focalfleet::testing
