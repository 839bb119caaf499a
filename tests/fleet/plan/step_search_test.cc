// Searches over sets of poses: for one unit against a plain table of costs, for two hooked units of
// a dense plate against what their arms need together.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/joint_search.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/soft_search.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using namespace test;

struct Surrounded {
  PlanningFleet fleet = FleetOf({UnitAt(1, 0)});
  Scene scene{fleet.layout, fleet.drives, fleet.start};
  TimeSteps steps{.ticks = 5340, .count = 62};
  Surround around;
  StepQuestion question;

  /// Cells are taken for a while each, as arms that pass take them.
  explicit Surrounded(Rng rng) {
    const ArmGeometry& arm = scene.arm(0);
    around.window = {.cell_mm = 1, .x0 = -17, .y0 = -17, .width = 35, .height = 35};
    for (std::size_t cell = 0; cell < around.window.cells(); ++cell) {
      const std::uint64_t from = rng.Below(64);
      const std::uint64_t bits = rng.Below(3) == 0 ? 0 : (std::uint64_t{1} << rng.Below(24)) - 1;
      around.bits.push_back(bits << from);
    }
    question = {.arm = &arm,
                .drive = &fleet.drives[0],
                .around = &around,
                .moving = {},
                .standing = {},
                .steps = steps,
                .from = PoseDeg(fleet, 0, -60, 130),
                .to = PoseDeg(fleet, 0, 95, 20),
                .within = arm.range(),
                .end_step = 50,
                .rests = {}};
  }

  /// The fewest steps that meet something, by a table of all poses and steps.
  [[nodiscard]] int LeastMet() const {
    PoseGrid grid;
    grid.SetUp(*question.drive, steps, question.from, question.to, question.within);
    FreePoses free;
    free.SetUp(question, grid);
    constexpr int kNone = std::numeric_limits<int>::max() / 2;
    const auto index = [&](const GridPose& at) {
      return static_cast<std::size_t>(at[0] * grid.count(1) + at[1]);
    };
    std::vector<int> least(static_cast<std::size_t>(grid.count(0) * grid.count(1)), kNone);
    least[index(grid.from())] = 0;
    for (std::int32_t step = 0; step < question.end_step; ++step) {
      std::vector<int> next(least.size(), kNone);
      for (std::int32_t a = 0; a < grid.count(0); ++a)
        for (std::int32_t b = 0; b < grid.count(1); ++b)
          for (std::int32_t da = -1; da <= 1; ++da)
            for (std::int32_t db = -1; db <= 1; ++db) {
              const GridPose from{a, b};
              const GridPose to{a + da, b + db};
              if (!grid.Contains(to) || !grid.Has(free.all(), to)) continue;
              const bool met = !grid.Has(free.In(step), from) || !grid.Has(free.In(step), to);
              next[index(to)] = std::min(next[index(to)], least[index(from)] + (met ? 1 : 0));
            }
      least = next;
    }
    return least[index(grid.to())];
  }
};

TEST(SoftSearch, MeetsOthersInAsFewStepsAsAnyWay) {
  int met = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    const std::uint64_t seed = Seed(k);
    FOCALFLEET_TRACE_SEED(seed);
    const Surrounded here(Rng::Stream(seed, "raster"));
    const int least = here.LeastMet();
    met += least;
    SoftSearch search;
    const auto found = search.Find(here.question);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->meets, least);
    Pose at = here.question.from;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      for (const Segment& segment : found->paths[axis].segments()) at[axis] += segment.delta;
    EXPECT_EQ(at, here.question.to);
  }
  EXPECT_GT(met, 0) << "nothing was in the way";
}

TEST(SoftSearch, RestsWherePowerHasNoRoom) {
  Surrounded here(Rng(1));
  std::fill(here.around.bits.begin(), here.around.bits.end(), 0);
  std::vector<std::uint8_t> rests(51, 0);
  std::fill(rests.begin() + 5, rests.begin() + 12, 1);
  here.question.rests = rests;
  SoftSearch search;
  const auto found = search.Find(here.question);
  ASSERT_TRUE(found);
  const double h = here.steps.step_s();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    for (const Segment& segment : found->paths[axis].segments()) {
      const double begin_s = segment.start_ticks * kTickS;
      const double end_s =
          begin_s + std::abs(segment.delta) * SecondsPerVector(here.fleet.drives[0].axis[axis]);
      EXPECT_TRUE(end_s <= 5 * h + 1e-6 || begin_s >= 12 * h - 1e-6) << begin_s << " " << end_s;
    }
}

/// Units 31 and 43 of a dense plate, alone: either has to make way for the other, twice.
TEST(PairSearch, HookedUnitsGoTogether) {
  const Layout plate = FleetOf(MakeHexLayout(SdssLike(500))).layout;
  const std::vector<UnitDrive> drives(plate.size());
  const std::vector<std::optional<Pose>> free(plate.size());
  const auto from = DrawConfiguration(plate, drives, free, Rng(4));
  const auto to = DrawConfiguration(plate, drives, free, Rng(504));
  ASSERT_TRUE(from && to);
  const std::array<PositionerIndex, 2> chosen{*plate.Find(UnitId{31}), *plate.Find(UnitId{43})};
  PlanningFleet fleet = FleetOf({plate.unit(chosen[0]), plate.unit(chosen[1])},
                                {.clearance_mm = plate.clearance_mm()});
  for (std::size_t m = 0; m < 2; ++m) {
    fleet.start[m] = Exactly(Witness::kReported, (*from)[chosen[m].value]);
    fleet.targets[m] = (*to)[chosen[m].value];
  }
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  ExpectSound(fleet, *plan);
  // A joint search over their four axes, with clearances at its nodes alone, finds 19 s.
  EXPECT_LE(plan->makespan_s, 1.05 * 19);
  EXPECT_GE(plan->makespan_s, plan->pair_bound_s);
}

/// Two units that reach over each other, among the covers of units whose place is not known.
struct Beset {
  PlanningFleet fleet = FleetOf({UnitAt(1, 0), UnitAt(2, 18)});
  Scene scene{fleet.layout, fleet.drives, fleet.start};
  std::vector<StandingThing> covers;
  std::array<std::array<Pose, 2>, 2> ends;  // of each member: from, to
  static constexpr double kNeedMm = 2;

  explicit Beset(Rng rng) {
    for (std::size_t end = 0; end < 2; ++end) {
      do
        for (std::uint32_t m = 0; m < 2; ++m)
          ends[m][end] = PoseDeg(fleet, m, rng.Uniform(-180, 180), rng.Uniform(0, 175));
      while (DistanceMm(ArmOf(0, end), ArmOf(1, end)) < kNeedMm + 0.5);
    }
    for (std::uint32_t by = 0; by < 12; ++by) {
      const PointFp around{rng.Uniform(-15, 33), rng.Uniform(-15, 15)};
      for (int k = 0; k < 40; ++k) {
        const double turn = 0.05 * k;
        const SegmentFp line{around,
                             {around.x_mm + 3 * std::cos(turn), around.y_mm + 3 * std::sin(turn)}};
        double least_mm = std::numeric_limits<double>::max();
        for (std::uint32_t m = 0; m < 2; ++m)
          for (std::size_t end = 0; end < 2; ++end)
            least_mm = std::min(least_mm, DistanceMm(ArmOf(m, end), line));
        if (least_mm > kNeedMm + 0.6) covers.push_back({{line, 0.1}, kNeedMm, kNeedMm, by, false});
      }
    }
  }
  [[nodiscard]] SegmentFp ArmOf(std::uint32_t m, std::size_t end) const {
    return scene.arm(m).At(ends[m][end]);
  }
  [[nodiscard]] std::optional<JointSearch::Found> Find(
      std::uint64_t seed, std::span<const StandingThing> things) const {
    JointSearch::Question question{.steps = {.ticks = 5340, .count = 190}, .end_step = 180};
    std::array<JointSearch::Member, 2> members;
    for (std::uint32_t m = 0; m < 2; ++m)
      members[m] = {.arm = &scene.arm(m),
                    .drive = &fleet.drives[m],
                    .standing = things,
                    .from = ends[m][0],
                    .to = ends[m][1],
                    .within = scene.arm(m).range()};
    question.members = members;
    question.need_mm[0][1] = kNeedMm;
    Rng rng(seed);
    return JointSearch().Find(question, &rng);
  }
};

TEST(JointSearch, WaysAreClearOfCoversHoweverTheyAreBundled) {
  int found_ways = 0;
  for (std::uint64_t k = 0; k < 40; ++k) {
    const std::uint64_t seed = Seed(k);
    FOCALFLEET_TRACE_SEED(seed);
    const Beset here(Rng::Stream(seed, "covers"));
    const auto found = here.Find(seed, here.covers);
    std::vector<StandingThing> alone = here.covers;  // each thing is a bundle
    for (std::uint32_t n = 0; n < alone.size(); ++n) alone[n].by = n;
    const auto again = here.Find(seed, alone);
    ASSERT_EQ(found.has_value(), again.has_value());
    if (!found) continue;
    ++found_ways;
    std::array<Track, 2> tracks;
    for (std::uint32_t m = 0; m < 2; ++m) {
      for (std::size_t axis = 0; axis < kAxisCount; ++axis)
        EXPECT_TRUE(
            std::ranges::equal(found->paths[m][axis].segments(), again->paths[m][axis].segments()));
      tracks[m] = Track(here.scene.arm(m), here.fleet.drives[m], here.ends[m][0], found->paths[m]);
    }
    // Within a step arms come nearer than at the three looks by little.
    constexpr double kWithinStepMm = 0.05;
    for (double t_s = 0; t_s < std::max(tracks[0].end_s(), tracks[1].end_s()); t_s += 0.05) {
      std::array<SegmentFp, 2> arms;
      for (std::uint32_t m = 0; m < 2; ++m) {
        const auto legs = tracks[m].legs();
        const auto leg = std::find_if(legs.begin(), legs.end(),
                                      [&](const Leg& each) { return t_s < each.end_s; });
        arms[m] = ArmAt(here.scene.arm(m), *leg, t_s);
        for (const StandingThing& thing : here.covers)
          ASSERT_GT(DistanceMm(arms[m], thing.capsule.line),
                    thing.need_mm + thing.capsule.radius_mm - kWithinStepMm);
      }
      ASSERT_GT(DistanceMm(arms[0], arms[1]), Beset::kNeedMm - kWithinStepMm);
    }
  }
  EXPECT_GT(found_ways, 10);
  EXPECT_LT(found_ways, 40) << "the covers stand in nobody's way";
}

TEST(Scene, AUnitOfUnknownPlaceTakesTheDiscThatItReaches) {
  const PlanningFleet fleet = FleetOf({UnitAt(1, 3)});
  const Scene scene(fleet.layout, fleet.drives, fleet.start);
  const ArmGeometry& arm = scene.arm(0);
  const std::vector<Capsule> cover = CoverOf(arm, arm.range(), 0.05);
  ASSERT_EQ(cover.size(), 1u);
  EXPECT_NEAR(cover[0].radius_mm, 16.5, 1e-9);
  PoseBox folded = arm.range();
  folded.low[1] = folded.high[1] / 2;
  const std::vector<Capsule> half = CoverOf(arm, folded, 0.05);
  ASSERT_EQ(half.size(), 1u);
  EXPECT_NEAR(half[0].radius_mm, 8.25 * std::numbers::sqrt2, 0.01);
}

}  // namespace
}  // namespace focalfleet
