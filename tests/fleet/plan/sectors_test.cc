// A plate planned by sectors: the whole is as clear as one plan, wherever and whenever each sector
// is planned.
#include "fleet/plan/sectors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <thread>

#include "fleet/plan/power_statement.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::HexFleet;
using test::MoveOf;
using test::PlanningFleet;
using test::TestSeed;

constexpr std::uint32_t kCounts[] = {2, 3, 4, 7};

PlanningFleet Drawn(std::uint32_t count, std::uint64_t seed) {
  PlanningFleet fleet = HexFleet(count);
  DrawStartAndTargets(&fleet, seed);
  return fleet;
}

void ExpectSame(const Plan& a, const Plan& b) {
  ASSERT_EQ(a.moves.size(), b.moves.size());
  for (std::size_t m = 0; m < a.moves.size(); ++m) {
    ASSERT_EQ(a.moves[m].unit, b.moves[m].unit);
    EXPECT_EQ(a.moves[m].to, b.moves[m].to);
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      const auto left = a.moves[m].path[k].segments();
      const auto right = b.moves[m].path[k].segments();
      EXPECT_TRUE(std::equal(left.begin(), left.end(), right.begin(), right.end(),
                             [](const Segment& x, const Segment& y) {
                               return x.start_ticks == y.start_ticks && x.delta == y.delta &&
                                      x.repeat == y.repeat;
                             }))
          << "unit index " << a.moves[m].unit.value;
    }
  }
}

TEST(Sectors, HaveEveryUnitOnceAndNoNeighboursInTheirTurn) {
  for (const std::uint32_t units : {61u, 500u, 3000u}) {
    const PlanningFleet fleet = HexFleet(units);
    for (const std::uint32_t count : kCounts) {
      const auto sectors = SplitIntoSectors(fleet.layout, {.count = count});
      ASSERT_TRUE(sectors) << sectors.error().text;
      ASSERT_EQ(sectors->size(), count);
      std::vector<std::uint32_t> sector_of(units, 99);
      for (std::uint32_t s = 0; s < count; ++s)
        for (const PositionerIndex i : (*sectors)[s].own) {
          EXPECT_EQ(sector_of[i.value], 99u);
          sector_of[i.value] = s;
        }
      for (std::uint32_t i = 0; i < units; ++i) {
        ASSERT_LT(sector_of[i], count);
        for (const PositionerIndex j : fleet.layout.neighbours({i})) {
          const Sector& mine = (*sectors)[sector_of[i]];
          const std::uint32_t other = sector_of[j.value];
          if (other == sector_of[i]) continue;
          EXPECT_NE((*sectors)[other].turn, mine.turn);
          EXPECT_TRUE(std::binary_search(mine.halo.begin(), mine.halo.end(), j));
          EXPECT_EQ(std::binary_search(mine.after.begin(), mine.after.end(), other),
                    (*sectors)[other].turn < mine.turn);
        }
      }
      const auto [least, most] = std::minmax_element(
          sectors->begin(), sectors->end(),
          [](const Sector& a, const Sector& b) { return a.own.size() < b.own.size(); });
      EXPECT_LE(most->own.size(), 2 * least->own.size());
    }
  }
}

TEST(Sectors, KeepBusesWholeWhereThereAreMany) {
  const PlanningFleet fleet = HexFleet(3000);
  const auto sectors = SplitIntoSectors(fleet.layout, {.count = 7});
  ASSERT_TRUE(sectors);
  std::map<std::uint32_t, std::size_t> sector_of_bus;
  for (std::size_t s = 0; s < sectors->size(); ++s)
    for (const PositionerIndex i : (*sectors)[s].own) {
      const auto [it, fresh] = sector_of_bus.emplace(fleet.layout.unit(i).bus.value, s);
      EXPECT_EQ(it->second, s);
    }
}

TEST(Sectors, RefuseMoreThanThereCanBe) {
  const PlanningFleet fleet = HexFleet(5);
  EXPECT_FALSE(SplitIntoSectors(fleet.layout, {.count = 6}));
  EXPECT_FALSE(SplitIntoSectors(fleet.layout, {.count = 0}));
  const auto rails = SplitIntoSectors(fleet.layout, {.count = 2, .whole_rails = true});
  ASSERT_FALSE(rails);
  EXPECT_NE(rails.error().text.find("between 1 and 1"), std::string::npos) << rails.error().text;
}

TEST(Sectors, TogetherServeAndClearAllAsOnePlanDoes) {
  for (std::uint64_t k = 0; k < 2; ++k) {
    const std::uint64_t seed = TestSeed(700 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(k == 0 ? 271 : 217, seed);
    for (const std::uint32_t count : kCounts) {
      SCOPED_TRACE(count);
      const auto made = PlanBySectors(fleet.request(), {}, {.count = count});
      ASSERT_TRUE(made) << made.error().text;
      EXPECT_TRUE(made->plan.unserved.empty());
      ExpectSound(fleet, made->plan);
      EXPECT_EQ(made->sectors.size() + made->merged, count);
      std::printf("FOCALFLEET_SEED=%llu %u sectors, %u merged: %.3f times the bound\n",
                  static_cast<unsigned long long>(seed), count, made->merged,
                  made->plan.makespan_s / made->plan.bound_s);
    }
  }
}

TEST(Sectors, AreTheSameForAnyOrderOfComputing) {
  const std::uint64_t seed = TestSeed(720);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(271, seed);
  const PlanRequest request = fleet.request();
  const auto made = PlanBySectors(request, {}, {.count = 7});
  ASSERT_TRUE(made);
  const std::vector<Sector>& sectors = made->sectors;
  for (std::uint64_t round = 0; round < 3; ++round) {
    Rng rng = Rng::Stream(seed + round, "order");
    std::vector<std::optional<SectorPlan>> plans(sectors.size());
    std::vector<std::uint32_t> ready;
    for (std::size_t done = 0; done < sectors.size(); ++done) {
      ready.clear();
      for (std::uint32_t s = 0; s < sectors.size(); ++s)
        if (!plans[s] && std::all_of(sectors[s].after.begin(), sectors[s].after.end(),
                                     [&](std::uint32_t before) { return plans[before]; }))
          ready.push_back(s);
      ASSERT_FALSE(ready.empty());
      const std::uint32_t which = ready[rng.Below(ready.size())];
      // The sector must not look at more than the plans that it comes after.
      std::vector<std::optional<SectorPlan>> seen(sectors.size());
      for (const std::uint32_t before : sectors[which].after) seen[before] = plans[before];
      auto plan = PlanSector(request, {}, sectors, seen, which);
      ASSERT_TRUE(plan) << plan.error().text;
      for (const UnitPlan& move : plan->plan.moves)
        EXPECT_TRUE(
            std::binary_search(sectors[which].own.begin(), sectors[which].own.end(), move.unit));
      plans[which] = std::move(*plan);
    }
    const auto joined = JoinSectors(request, {}, sectors, plans);
    ASSERT_TRUE(joined) << joined.error().text;
    ExpectSame(*joined, made->plan);
  }
}

TEST(Sectors, TwoThreadsMakeTheSamePlanAsOne) {
  const std::uint64_t seed = TestSeed(725);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(500, seed);
  const PlanRequest request = fleet.request();
  const auto made = PlanBySectors(request, {}, {.count = 6});
  const auto whole = MakePlan(request, {});
  ASSERT_TRUE(made && whole);
  const std::vector<Sector>& sectors = made->sectors;
  std::vector<std::optional<SectorPlan>> plans(sectors.size());
  for (std::uint32_t turn = 0; turn < 2; ++turn) {
    // The results of a turn are looked at in the next turn only.
    const std::vector<std::optional<SectorPlan>> before = plans;
    const auto every_other = [&](std::uint32_t first) {
      for (std::uint32_t s = 0, n = 0; s < sectors.size(); ++s) {
        if (sectors[s].turn != turn || n++ % 2 != first) continue;
        auto plan = PlanSector(request, {}, sectors, before, s);
        if (plan) plans[s] = std::move(*plan);
      }
    };
    std::thread other(every_other, 1);
    every_other(0);
    other.join();
  }
  const auto joined = JoinSectors(request, {}, sectors, plans);
  ASSERT_TRUE(joined) << joined.error().text;
  ExpectSame(*joined, made->plan);
  std::optional<Plan> again;
  std::thread other([&] { again = *MakePlan(request, {}); });
  const auto beside = MakePlan(request, {});
  other.join();
  ExpectSame(*again, *whole);
  ExpectSame(*beside, *whole);
}

/// All motions begin this much later.
void Delay(Plan* plan, std::uint32_t ticks) {
  for (UnitPlan& move : plan->moves)
    for (AxisPath& path : move.path) {
      AxisPath late;
      for (Segment segment : path.segments()) {
        segment.start_ticks += ticks;
        late.Append(segment);
      }
      path = late;
    }
}

TEST(Sectors, GoAroundWhatIsGivenWhateverThatIs) {
  for (std::uint64_t k = 0; k < 3; ++k) {
    const std::uint64_t seed = TestSeed(725 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(217, seed);
    const PlanRequest request = fleet.request();
    const auto sectors = SplitIntoSectors(fleet.layout, {.count = 2});
    ASSERT_TRUE(sectors);
    std::vector<std::optional<SectorPlan>> plans(2);
    for (std::uint32_t s = 0; s < 2; ++s) {
      auto plan = PlanSector(request, {}, *sectors, plans, s);
      ASSERT_TRUE(plan) << plan.error().text;
      plans[s] = std::move(*plan);
      // The first goes as a whole later than it proposed.
      plans[s]->proposals.clear();
      if (s == 0) Delay(&plans[s]->plan, 70'000);
    }
    const auto joined = JoinSectors(request, {}, *sectors, plans);
    ASSERT_TRUE(joined) << joined.error().text;
    ExpectSound(fleet, *joined);
  }
}

TEST(Planner, LeavesGivenMotionsAsTheyAre) {
  for (std::uint64_t k = 0; k < 4; ++k) {
    const std::uint64_t seed = TestSeed(760 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(127, seed);
    const auto before = MakePlan(fleet.request(), {});
    ASSERT_TRUE(before);
    std::vector<AxisPaths> motions(127);
    std::vector<std::uint8_t> given(127, 0);
    Plan late = *before;
    if (k % 2 == 1) Delay(&late, 100'000);  // these end when no other unit needs to move
    for (const UnitPlan& move : late.moves) {
      if (move.unit.value % 3 != 0) continue;
      motions[move.unit.value] = move.path;
      given[move.unit.value] = 1;
    }
    PlanRequest request = fleet.request();
    request.motions = motions;
    request.given = given;
    PlanOptions options;
    options.seed = 77;
    const auto after = MakePlan(request, options);
    ASSERT_TRUE(after) << after.error().text;
    ExpectSound(fleet, *after);
    Plan kept = late;
    Plan found = *after;
    const auto others = [](const UnitPlan& move) { return move.unit.value % 3 != 0; };
    std::erase_if(kept.moves, others);
    std::erase_if(found.moves, others);
    ExpectSame(kept, found);
  }
}

TEST(Planner, RefusesGivenMotionsThatEndOnAnotherUnit) {
  PlanningFleet fleet = HexFleet(7);
  const Unit& middle = fleet.layout.unit({0});
  const Unit& other = fleet.layout.unit({1});
  const auto pose = [](const Unit& unit, double theta_deg, double phi_deg) {
    return Pose{NearestVectors(theta_deg, unit.axis[0], {}),
                NearestVectors(phi_deg, unit.axis[1], {})};
  };
  const double to_other_deg =
      std::atan2(other.base_fp.y_mm, other.base_fp.x_mm) * 180 / std::numbers::pi;
  const double to_middle_deg = to_other_deg > 0 ? to_other_deg - 180 : to_other_deg + 180;
  std::vector<Pose> start;
  for (std::uint32_t i = 0; i < 7; ++i) start.push_back(pose(fleet.layout.unit({i}), 0, 175));
  // The first unit stands with its arm towards the other, which shall turn around and unfold over
  // it.
  start[0] = pose(middle, to_other_deg, 0);
  start[1] = pose(other, to_other_deg, 175);
  fleet.StandAt(start);
  std::vector<AxisPaths> motions(7);
  motions[1][0].Append({0, pose(other, to_middle_deg, 0)[0] - start[1][0], 108});
  motions[1][1].Append({200'000, -start[1][1], 108});
  std::vector<std::uint8_t> given(7, 0);
  given[1] = 1;
  PlanRequest request = fleet.request();
  request.motions = motions;
  request.given = given;
  const auto none = MakePlan(request, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kRefused);
  EXPECT_NE(none.error().text.find("motions that are given, unit 1"), std::string::npos)
      << none.error().text;
  // With its arm folded and turned away there is room.
  fleet.targets[0] = pose(middle, to_other_deg > 0 ? to_other_deg - 90 : to_other_deg + 90, 175);
  const auto plan = MakePlan(request, {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
}

TEST(Sectors, ThatDoNotFitAreRefusedByName) {
  const std::uint64_t seed = TestSeed(730);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(217, seed);
  const PlanRequest request = fleet.request();
  auto sectors = SplitIntoSectors(fleet.layout, {.count = 2});
  ASSERT_TRUE(sectors);
  // Each sector is planned as if it were alone: the other side's motions are only its own
  // proposals.
  for (Sector& sector : *sectors) sector.after.clear();
  std::vector<std::optional<SectorPlan>> plans(2);
  for (std::uint32_t s = 0; s < 2; ++s) {
    PlanOptions options;
    options.seed = 1 + s;
    auto plan = PlanSector(request, options, *sectors, plans, s);
    ASSERT_TRUE(plan);
    plans[s] = std::move(*plan);
  }
  // A sector is late as a whole: the motions across the border no longer fit.
  Delay(&plans[1]->plan, 150'000);
  const auto joined = JoinSectors(request, {}, *sectors, plans);
  ASSERT_FALSE(joined);
  EXPECT_EQ(joined.error().code, ErrorCode::kRefused);
  EXPECT_NE(joined.error().text.find("across a border: units "), std::string::npos)
      << joined.error().text;
}

TEST(Sectors, GoAroundWhatStandsOnEitherSide) {
  const std::uint64_t seed = TestSeed(740);
  FOCALFLEET_TRACE_SEED(seed);
  PlanningFleet fleet = HexFleet(217);
  for (std::uint32_t i = 0; i < 217; i += 9) fleet.frozen[i] = 1;
  DrawStartAndTargets(&fleet, seed);
  const auto made = PlanBySectors(fleet.request(), {}, {.count = 4});
  ASSERT_TRUE(made) << made.error().text;
  ExpectSound(fleet, made->plan);
  for (std::uint32_t i = 0; i < 217; i += 9) EXPECT_EQ(MoveOf(made->plan, i), nullptr);
}

TEST(Sectors, KeepLimitsOfPowerTogether) {
  const std::uint64_t seed = TestSeed(745);
  FOCALFLEET_TRACE_SEED(seed);
  PlanningFleet fleet = FleetOf(MakeHexLayout({.count = 127, .units_per_rail = 32}));
  DrawStartAndTargets(&fleet, seed);
  const auto free = MakePlan(fleet.request(), {});
  ASSERT_TRUE(free);
  const PowerStatement drawn = StatePower(*free, fleet.layout, fleet.drives, {});
  PlanOptions options;
  options.power = {.rail_W = 0.7 * drawn.LargestRail_W(), .total_W = 0.6 * drawn.peak_most_W};
  const auto made = PlanBySectors(fleet.request(), options, {.count = 2});
  ASSERT_TRUE(made) << made.error().text;
  EXPECT_TRUE(made->plan.unserved.empty());
  ExpectSound(fleet, made->plan);
  const PowerStatement power = StatePower(made->plan, fleet.layout, fleet.drives, options);
  EXPECT_LE(power.LargestRail_W(), options.power.rail_W + 1e-6);
  EXPECT_LE(power.peak_most_W, options.power.total_W + 1e-6);
  EXPECT_FALSE(PlanBySectors(fleet.request(), options, {.count = 5})) << "there are four rails";
}

// A unit that counts from another zero than its geometry holds itself to its range by its count.
TEST(Sectors, HoldUnitsToTheRangeOfTheirCounts) {
  PlanningFleet fleet = Drawn(61, TestSeed(755));
  std::vector<Pose> offsets(fleet.layout.size());
  PlanRequest request = fleet.request();
  request.offsets = offsets;
  ASSERT_TRUE(PlanBySectors(request, {}, {.count = 4}));
  const std::uint32_t moved = 30;
  ASSERT_TRUE(fleet.targets[moved]);
  const Pose edge = PoseDeg(fleet, moved, fleet.layout.unit({moved}).theta().max_deg, 0);
  offsets[moved][0] = (*fleet.targets[moved])[0] - edge[0] - 10;
  const auto made = PlanBySectors(request, {}, {.count = 4});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().text, MakePlan(request, {}).error().text);
}

TEST(Sectors, BadTargetsAreAllNamedAtOnce) {
  PlanningFleet fleet = Drawn(217, TestSeed(750));
  for (const std::uint32_t i : {3u, 200u}) fleet.targets[i] = Pose{10'000'00, 0};
  const auto made = PlanBySectors(fleet.request(), {}, {.count = 4});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kInvalid);
  for (const char* name : {"unit 4 is outside", "unit 201 is outside"})
    EXPECT_NE(made.error().text.find(name), std::string::npos) << made.error().text;
}

}  // namespace
}  // namespace focalfleet
