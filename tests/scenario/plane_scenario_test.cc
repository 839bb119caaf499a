// A plane of several sectors on the network of a simulated night.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/scenario/plane_in_process.h"
#include "tests/scenario/plane_judge.h"
#include "tests/scenario/plane_night.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::kPlaneFaultCount;
using test::PlaneFault;
using test::PlaneInProcess;
using test::PlaneNightResult;
using test::RunPlaneNight;

std::uint64_t NumberOf(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

TEST(Plane, CarriesOutAConfigurationOverItsSectors) {
  PlaneInProcess plane({.sectors = 3, .units_per_sector = 8, .seed = 1, .times = {}, .agent = {}});
  test::PlaneJudge judge(&plane);
  plane.commanded = [&](std::uint32_t sector, const SectorAgent& agent, const Command& command) {
    judge.Commanded(sector, agent, command);
  };
  plane.looked = [&] { judge.Look(); };
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(20)));
  const auto targets = plane.DrawTargets(7);
  plane.Apply(targets);
  ASSERT_TRUE(plane.RunUntil([&] { return !plane.IsIdle(); }, Seconds(1)));
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(300)));
  const PlaneView& view = plane.plane().view();
  EXPECT_EQ(view.state, ConfigurationState::kDone);
  EXPECT_EQ(view.counts.arrived, 24u);
  EXPECT_EQ(view.rounds, 1u);
  judge.LookAtStores();
  judge.LookAtArrivals(targets);
  for (const std::string& broken : judge.broken()) ADD_FAILURE() << broken;
}

// Clocks of the hosts are up to 100 s apart and drift, and yet all units begin together.
TEST(Plane, UnitsOfAllSectorsBeginTogether) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    PlaneInProcess plane(
        {.sectors = 4, .units_per_sector = 6, .seed = seed, .times = {}, .agent = {}});
    ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(20)));
    plane.Apply(plane.DrawTargets(seed));
    ASSERT_TRUE(plane.RunUntil([&] { return plane.plane().view().phase == PlanePhase::kMoving; },
                               Seconds(30)));
    plane.Run(Seconds(6));
    // Units begin at offsets of the plan; the sectors' start instants are compared in true time.
    HostInstant first = kNever, last{INT64_MIN};
    for (const PlaneInProcess::Sector& sector : plane.sectors) {
      const HostInstant started = sector.coordinator->configuration().started;
      ASSERT_NE(started, kNever);
      const HostInstant at = started - (plane.OfSector(sector, plane.now()) - plane.now());
      first = std::min(first, at);
      last = std::max(last, at);
    }
    EXPECT_LE(last - first, Milliseconds(10));
  }
}

// Every kind of fault in every phase; docs/plane.md has what comes of it.
class PlaneFaultInPhase : public ::testing::TestWithParam<std::tuple<int, PlanePhase>> {};

TEST_P(PlaneFaultInPhase, KeepsEveryRule) {
  const auto [fault, phase] = GetParam();
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    const PlaneNightResult result = RunPlaneNight(
        {.seed = seed,
         .fault = static_cast<PlaneFault>(fault),
         .phase = phase,
         .after_s = phase == PlanePhase::kMoving ? 0.6 * static_cast<double>(seed * seed) : 0.02});
    for (const std::string& broken : result.broken) ADD_FAILURE() << broken;
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, PlaneFaultInPhase,
    ::testing::Combine(::testing::Range(0, static_cast<int>(kPlaneFaultCount)),
                       ::testing::Values(PlanePhase::kGathering, PlanePhase::kPlanning,
                                         PlanePhase::kPreparing, PlanePhase::kMoving,
                                         PlanePhase::kFinishing)),
    [](const auto& one) {
      return std::string(test::Name(static_cast<PlaneFault>(std::get<0>(one.param)))) + "_in_" +
             Name(std::get<1>(one.param));
    });

TEST(Plane, ASeedIsANight) {
  const PlaneNightResult one = RunPlaneNight({.seed = 11, .fault = {}});
  const PlaneNightResult again = RunPlaneNight({.seed = 11, .fault = {}});
  EXPECT_EQ(one.digest, again.digest);
}

// FOCALFLEET_PLANE_SEEDS asks for more nights, FOCALFLEET_SEED for one, FOCALFLEET_TELL for what
// happens in it.
TEST(Plane, NightsKeepEveryRule) {
  const std::uint64_t first = NumberOf("FOCALFLEET_SEED", 1);
  const std::uint64_t count =
      std::getenv("FOCALFLEET_SEED") != nullptr ? 1 : NumberOf("FOCALFLEET_PLANE_SEEDS", 20);
  std::array<std::array<std::uint32_t, kPlanePhaseCount>, kPlaneFaultCount> struck{};
  std::uint64_t begun = 0, starts = 0, missed = 0, silent = 0, excused = 0, broken = 0;
  double virtual_s = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    const PlaneNightResult result = RunPlaneNight(
        {.seed = seed, .fault = {}, .tell = std::getenv("FOCALFLEET_TELL") != nullptr});
    for (const std::string& rule : result.broken) ADD_FAILURE() << rule;
    broken += result.broken.empty() ? 0u : 1u;
    for (std::size_t f = 0; f < kPlaneFaultCount; ++f)
      for (std::size_t p = 0; p < kPlanePhaseCount; ++p) struck[f][p] += result.struck[f][p];
    begun += result.begun;
    starts += result.starts;
    missed += result.missed;
    silent += result.silent;
    excused += result.excused;
    virtual_s += result.virtual_s;
  }
  const auto print = [](std::uint64_t number, const char* what) {
    std::printf("%llu %s\n", static_cast<unsigned long long>(number), what);
  };
  print(count, "nights");
  print(broken, "with a broken rule");
  print(static_cast<std::uint64_t>(virtual_s / 3600), "hours of virtual time");
  print(begun, "moves of units");
  print(starts, "starts of sectors");
  print(missed, "rounds given back");
  print(silent, "neighbours reported");
  print(excused, "contacts excused");
  std::printf("%-18s", "fault in phase");
  for (std::size_t p = 0; p < kPlanePhaseCount; ++p)
    std::printf("%10s", Name(static_cast<PlanePhase>(p)));
  for (std::size_t f = 0; f < kPlaneFaultCount; ++f) {
    std::printf("\n%-18s", test::Name(static_cast<PlaneFault>(f)));
    for (std::size_t p = 0; p < kPlanePhaseCount; ++p) std::printf("%10u", struck[f][p]);
  }
  std::printf("\n");
}

}  // namespace
}  // namespace focalfleet
