// A unit gets a new way while the others go on, clear of them all and within the limits of power.
#include "fleet/plan/replan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "tests/fleet/plan/replan_question.h"

namespace focalfleet {
namespace {

using test::Begun;
using test::DrawQuestion;
using test::DrawStartAndTargets;
using test::DrawTarget;
using test::ExpectClear;
using test::ExpectEndsAt;
using test::HasStaticWay;
using test::HexFleet;
using test::kDraws;
using test::kLateSkewS;
using test::kNever;
using test::kSeeds;
using test::PlanningFleet;
using test::TestSeed;
using test::UnderWay;
using test::WouldMeet;

TEST(Replan, IsClearOfAllOthersForEverySkewAndClock) {
  int asked = 0;
  int served = 0;
  int failed = 0;
  int collides = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(700 + k);
    FOCALFLEET_TRACE_SEED(seed);
    // Notice covers much of what clocks need: every other plate goes without.
    const PlanOptions options{.notice_s = k % 2 == 0 ? 1.0 : 0.0};
    auto fleet = Begun(300 + static_cast<std::uint32_t>(k) * 25, seed, options);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "replan");
    for (int n = 0; n < kDraws; ++n) {
      const auto draw = DrawQuestion(&*fleet, &rng, n % 8 < 4 ? 0 : 1 + n % 3);
      if (!draw) continue;
      const auto late = fleet->running().Replan(draw->question, draw->deviations);
      if (!late && late.error().code == ErrorCode::kInvalid) {
        EXPECT_TRUE(draw->failed) << late.error().text;
        ++collides;
        continue;
      }
      ++asked;
      if (!late) {
        EXPECT_FALSE(HasStaticWay(*fleet, draw->question)) << late.error().text;
        continue;
      }
      ++served;
      failed += draw->failed ? 1 : 0;
      ExpectEndsAt(*late, draw->question);
      ExpectClear(&*fleet, *late, draw->question.now_s);
    }
  }
  std::printf(
      "%d questions, %d served (%d beside a failed unit); %d targets on a failed unit's interval\n",
      asked, served, failed, collides);
  EXPECT_GE(served, asked * 9 / 10);
  EXPECT_GT(failed, 10);
}

bool GoesStraightAtOnce(const LateMove& late) {
  return std::all_of(late.move.path.begin(), late.move.path.end(), [](const AxisPath& path) {
    return path.size() == 0 || (path.size() == 1 && path.segments()[0].start_ticks == 0);
  });
}

/// The neighbours of the unit go from one random configuration to another; the unit stands.
std::optional<UnderWay> BegunAround(std::uint32_t unit, std::uint64_t seed) {
  PlanningFleet fleet = HexFleet(7);
  DrawStartAndTargets(&fleet, seed);
  std::vector<std::optional<Pose>> standing(fleet.layout.size());
  standing[unit] = PlaceOf(fleet.start[unit]);
  const auto to =
      DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(seed, "targets"));
  if (!to) return std::nullopt;
  fleet.targets.assign(to->begin(), to->end());
  fleet.targets[unit].reset();
  const PlanOptions options{.fixed = true, .notice_s = 0};
  auto plan = MakePlan(fleet.request(), options);
  if (!plan || !plan->unserved.empty()) return std::nullopt;
  return std::optional<UnderWay>(std::in_place, std::move(fleet), options, std::move(*plan));
}

// The straight way opens or closes while a neighbour passes. At that moment only the tolerance of
// clocks and skews keeps the two apart.
TEST(Replan, HoldsWhereTheStraightWayJustOpensOrCloses) {
  constexpr double kStepS = 0.02;
  int turns = 0;
  int tight = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const std::uint64_t seed = TestSeed(1000 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const std::uint32_t unit = 3;  // has all others around it
    auto fleet = BegunAround(unit, seed);
    if (!fleet) continue;
    const auto target = DrawTarget(*fleet, unit, Rng::Stream(seed, "target"));
    ASSERT_TRUE(target);
    ReplanQuestion question{.unit = {unit}, .from = fleet->EndPose(unit), .to = *target};
    std::optional<LateMove> before;
    for (; question.start_s < fleet->plan().makespan_s; question.start_s += kStepS) {
      const auto late = fleet->running().Replan(question, {});
      if (!late) break;
      if (before && GoesStraightAtOnce(*late) != GoesStraightAtOnce(*before)) {
        ++turns;
        const LateMove& clear = GoesStraightAtOnce(*late) ? *late : *before;
        tight += WouldMeet(&*fleet, clear, 0, 0.5) ? 1 : 0;
        for (int corner = 0; corner < 4; ++corner) {
          fleet->SetClocks(corner);
          ExpectClear(&*fleet, clear, 0);
        }
      }
      before = *late;
    }
  }
  std::printf("%d times the straight way opens or closes; %d of them are tight\n", turns, tight);
  EXPECT_GT(tight, 5);
}

TEST(Replan, KeepsLimitsOfPower) {
  const std::uint64_t seed = TestSeed(760);
  FOCALFLEET_TRACE_SEED(seed);
  PlanOptions options;
  DrivePowers powers{options.motor};
  // The power of about eight motors of a rail: waiting is needed.
  const double motor_W = powers.Of({AxisDrive{}, WaveMode::kAsymmetric, 1.8}).total_W();
  options.power.total_W = 30.5 * motor_W;
  auto fleet = Begun(61, seed, options);
  ASSERT_TRUE(fleet);
  Rng rng = Rng::Stream(seed, "power");
  const auto runs_of = [&](const AxisPaths& paths, double offset_s, double skew_s,
                           std::map<double, int>* changes) {
    for (const AxisPath& path : paths) {
      for (const Segment& segment : path.segments()) {
        const double t0_s = segment.start_ticks * 1e-4;
        const double t1_s = t0_s + std::abs(segment.delta) * (segment.repeat * 500 / 144e6);
        ++(*changes)[(offset_s + t0_s) / 1.005 - skew_s];
        --(*changes)[(offset_s + t1_s) / 0.995 + skew_s];
      }
    }
  };
  int served = 0;
  int full = 0;
  for (int n = 0; n < 40; ++n) {
    const auto draw = DrawQuestion(&*fleet, &rng, 0);
    if (!draw || draw->failed) continue;
    const auto late = fleet->running().Replan(draw->question, draw->deviations);
    if (!late) continue;
    ++served;
    std::map<double, int> changes;
    for (const UnitPlan& move : fleet->plan().moves)
      if (fleet->StopOf(move.unit.value) == kNever && move.unit.value != draw->unit)
        runs_of(move.path, 0, options.start_skew_s, &changes);
    runs_of(late->move.path, late->start_s, kLateSkewS, &changes);
    int motors = 0;
    int most = 0;
    for (const auto& [t_s, change] : changes) most = std::max(most, motors += change);
    EXPECT_LE(most, 30);
    full += most == 30 ? 1 : 0;
  }
  EXPECT_GT(served, 20);
  EXPECT_GT(full, 5) << "the limit is never reached, the test proves nothing";
}

}  // namespace
}  // namespace focalfleet
