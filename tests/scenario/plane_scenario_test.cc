// A plane of several sectors on the network of a simulated night.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <utility>

#include "tests/scenario/plane_in_process.h"
#include "tests/scenario/plane_judge.h"
#include "tests/scenario/plane_night.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::kPlaneFaultCount;
using test::PlaneFate;
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

// Messages to and from one sector take so long that its clock is known to less than plans allow
// for.
TEST(Plane, AClockThatIsKnownTooBadlyIsAnAlarmUntilItIsKnownAgain) {
  PlaneInProcess plane({.sectors = 3, .units_per_sector = 6, .seed = 3, .times = {}, .agent = {}});
  const std::vector<ShellNote>& notes = plane.planes[0].notes;
  ASSERT_TRUE(plane.RunUntil([&] { return plane.IsIdle(); }, Seconds(20)));
  plane.Run(Seconds(10));
  EXPECT_TRUE(notes.empty()) << notes[0].text;
  plane.network.slow[1] = Milliseconds(8);
  ASSERT_TRUE(plane.RunUntil([&] { return !notes.empty(); }, Seconds(120)));
  EXPECT_EQ(notes[0].name, AlarmName::kSectorClockLoose);
  EXPECT_NE(notes[0].text.find("sector 1 has a clock that is known to"), std::string::npos)
      << notes[0].text;
  EXPECT_EQ(notes[0].text.find("sector 0"), std::string::npos) << notes[0].text;
  // A further sector raises the alarm again, with both.
  plane.network.slow[2] = Milliseconds(8);
  ASSERT_TRUE(plane.RunUntil([&] { return notes.size() == 2; }, Seconds(120)));
  EXPECT_EQ(notes[1].name, AlarmName::kSectorClockLoose);
  EXPECT_NE(notes[1].text.find("sector 1"), std::string::npos) << notes[1].text;
  EXPECT_NE(notes[1].text.find("sector 2"), std::string::npos) << notes[1].text;
  plane.network.slow.erase(1);
  plane.Run(Seconds(60));
  ASSERT_EQ(notes.size(), 2u) << notes.back().text;
  plane.network.slow.clear();
  ASSERT_TRUE(plane.RunUntil([&] { return notes.size() == 3; }, Seconds(60)));
  EXPECT_EQ(notes[2].name, AlarmName::kSectorClocksGood);
  EXPECT_EQ(notes[2].ends, AlarmName::kSectorClockLoose);
}

/// Results of the nights of one kind of fault in one phase.
struct Fates {
  std::uint32_t nights = 0;
  std::uint32_t struck = 0;  // in this phase
  PlaneFate victims;
  PlaneFate others;
  std::uint32_t rounds_most = 0;
  std::uint64_t given_back = 0;
  std::uint32_t completed = 0;  // nights whose last configuration brought all units

  void Add(const PlaneNightResult& night, bool in_phase) {
    ++nights;
    struck += in_phase ? 1u : 0u;
    for (const auto& [from, to] :
         {std::pair(&night.victims, &victims), std::pair(&night.others, &others)}) {
      to->units += from->units;
      for (std::size_t n = 0; n < from->outcomes.size(); ++n) to->outcomes[n] += from->outcomes[n];
    }
    rounds_most = std::max(rounds_most, night.rounds);
    given_back += night.missed;
    completed += night.completed == night.victims.units + night.others.units ? 1u : 0u;
  }
};

std::string TextOf(const PlaneFate& fate) {
  std::string text;
  std::uint32_t left_out = 0;
  for (std::size_t n = 0; n < fate.outcomes.size(); ++n) {
    const auto outcome = static_cast<TargetOutcome>(n);
    if (outcome == TargetOutcome::kNone || outcome == TargetOutcome::kPending) {
      left_out += fate.outcomes[n];
    } else if (fate.outcomes[n] == fate.units) {
      return std::string("all ") + Name(outcome);
    } else if (fate.outcomes[n] > 0) {
      text += (text.empty() ? "" : ", ") + std::to_string(fate.outcomes[n]) + " " + Name(outcome);
    }
  }
  if (left_out == fate.units) return "all left out";
  if (left_out > 0) text += (text.empty() ? "" : ", ") + std::to_string(left_out) + " left out";
  return text;
}

// Every kind of fault in every phase; docs/plane.md has what comes of it, from the table that is
// printed.
class PlaneFaultInPhase : public ::testing::TestWithParam<std::tuple<int, PlanePhase>> {
 protected:
  static void TearDownTestSuite() {
    std::printf(
        "| fault | in phase | the sector's units | all other units | rounds, at most | given "
        "back | afterwards |\n|---|---|---|---|---:|---:|---|\n");
    for (const auto& [key, fates] : fates_)
      std::printf("| %s | %s | %s | %s | %u | %llu | %u of %u whole |\n",
                  test::Name(static_cast<PlaneFault>(key.first)), Name(key.second),
                  TextOf(fates.victims).c_str(), TextOf(fates.others).c_str(), fates.rounds_most,
                  static_cast<unsigned long long>(fates.given_back), fates.completed, fates.nights);
    fates_.clear();
  }
  static double AfterSeconds(PlanePhase phase, std::uint64_t seed) {
    if (phase == PlanePhase::kMoving) return 0.6 * static_cast<double>(seed * seed);
    // A record is durable after 5 ms.
    const bool is_record = phase == PlanePhase::kRecording || phase == PlanePhase::kClaiming;
    return is_record ? 0.001 : 0.02;
  }
  static std::map<std::pair<int, PlanePhase>, Fates> fates_;
};
std::map<std::pair<int, PlanePhase>, Fates> PlaneFaultInPhase::fates_;

TEST_P(PlaneFaultInPhase, KeepsEveryRule) {
  const auto [fault, phase] = GetParam();
  Fates& fates = fates_[{fault, phase}];
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    const PlaneNightResult result = RunPlaneNight({.seed = seed,
                                                   .fault = static_cast<PlaneFault>(fault),
                                                   .phase = phase,
                                                   .after_s = AfterSeconds(phase, seed)});
    for (const std::string& broken : result.broken) ADD_FAILURE() << broken;
    fates.Add(result,
              result.struck[static_cast<std::size_t>(fault)][static_cast<std::size_t>(phase)] > 0);
  }
  EXPECT_GT(fates.struck, 0u) << "the fault never struck in this phase";
  // The units of a sector that was killed have arrived, and its next life says so.
  if (fault == static_cast<int>(PlaneFault::kKillSector) && phase == PlanePhase::kFinishing) {
    EXPECT_EQ(TextOf(fates.victims), "all arrived");
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, PlaneFaultInPhase,
    ::testing::Combine(::testing::Range(0, static_cast<int>(kPlaneFaultCount)),
                       ::testing::Values(PlanePhase::kClaiming, PlanePhase::kRecording,
                                         PlanePhase::kGathering, PlanePhase::kPlanning,
                                         PlanePhase::kPreparing, PlanePhase::kMoving,
                                         PlanePhase::kFinishing, PlanePhase::kMeasuring)),
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
