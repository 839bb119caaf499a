// Each follower of each unit is stopped by itself, with the two clocks as far apart as they may be.
// The time that the plan leaves for the stop is enough.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/stopped.h"

namespace focalfleet {
namespace {

using test::DrawStartAndTargets;
using test::HexFleet;
using test::kBeforeS;
using test::kNever;
using test::PlanningFleet;
using test::Stopped;
using test::StopSafety;
using test::TestSeed;
using test::UnnoticedPairs;

struct SingleStops {
  int draws = 0;
  int stopped = 0;
  int matters = 0;    // unclear without the stop
  int unclear = 0;    // with the stop after the time that the plan leaves
  int unnoticed = 0;  // with the stop after the notice, where the plan leaves less
  int not_named = 0;  // with the stop after the notice, where the plan says that this is in time
};

void StopEveryFollower(Stopped* fleet, Rng* rng, int times) {
  const PlanOptions& options = fleet->options();
  SingleStops count;
  for (const UnitPlan& move : fleet->plan().moves) {
    const std::uint32_t i = move.unit.value;
    for (const UnitPlan::Follower& follower : move.followers) {
      const std::uint32_t j = follower.unit.value;
      for (int n = 0; n < times; ++n) {
        const double sign = n % 2 == 0 ? 1 : -1;
        fleet->GoOn();
        fleet->SetClock(i, {sign * options.start_skew_s, 1 - sign * options.clock_error});
        fleet->SetClock(j, {-sign * options.start_skew_s, 1 + sign * options.clock_error});
        // Before `since_s` and after `left_s` the end does not concern the follower: that is tested
        // too. A stop before `begins_s` cannot come too late, so most ends are drawn where it comes
        // later.
        const bool early = rng->Uniform() < 0.25;
        const double late_s = std::max(follower.since_s, follower.begins_s - options.notice_s);
        const double t_s =
            rng->Uniform(early ? follower.since_s - 1 : late_s, follower.left_s + (early ? 1 : 0));
        if (t_s < 0 || !fleet->Moves(i, t_s)) continue;
        ++count.draws;
        const auto unclear_with = [&](double stop_s) {
          fleet->StopAt(i, t_s);
          fleet->StopAt(j, stop_s);
          return !fleet->Check({i, j}, t_s - kBeforeS).pairs.empty();
        };
        const bool concerned = t_s >= follower.since_s && t_s <= follower.left_s;
        count.stopped += concerned ? 1 : 0;
        if (!unclear_with(kNever)) continue;
        ++count.matters;
        const double left_s = fleet->LeftS(i, j, t_s);
        if (!concerned || unclear_with(t_s + left_s)) {
          if (++count.unclear <= 5)
            std::printf("UNCLEAR %s\n", fleet->Describe(std::minmax(i, j)).c_str());
        }
        if (concerned && unclear_with(t_s + options.notice_s))
          ++(left_s < options.notice_s ? count.unnoticed : count.not_named);
      }
    }
  }
  std::printf(
      "every follower: %d draws, %d stops, %d unclear without; unclear with the stop in the time "
      "that is left %d; with the stop after the notice %d named, %d not\n",
      count.draws, count.stopped, count.matters, count.unclear, count.unnoticed, count.not_named);
  EXPECT_EQ(count.unclear, 0);
  EXPECT_EQ(count.not_named, 0);
  EXPECT_GT(count.matters, 0) << "the stops made no difference, the test proves nothing";
}

class StopFollowers : public StopSafety {};

TEST_P(StopFollowers, EveryFollowerIsStoppedInTime) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop pairs");
  StopEveryFollower(&*fleet_, &rng, 16);
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopFollowers, ::testing::Range(1, 4));

// Where units stand so dense that they go in an order, no pair is proven with notice. The plan's
// statements of the time that is left must hold all the same.
class StopFollowersInOrder : public StopSafety {
 protected:
  [[nodiscard]] std::vector<Unit> Plate() const override { return MakeHexLayout(SdssLike(1000)); }
};

TEST_P(StopFollowersInOrder, EveryFollowerIsStoppedInTimeOrNamed) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop pairs");
  const Plan& plan = fleet_->plan();
  std::printf("makespan %.2f s, crossings %u, unnoticed pairs %zu\n", plan.makespan_s,
              plan.crossings, UnnoticedPairs(fleet_->plan()));
  StopEveryFollower(&*fleet_, &rng, 16);
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopFollowersInOrder, ::testing::Values(1));

TEST(StopTimes, TheTimeThatIsLeftHoldsForBadClocks) {
  PlanningFleet fleet = HexFleet(127);
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    FOCALFLEET_TRACE_SEED(TestSeed(seed));
    ASSERT_NO_FATAL_FAILURE(DrawStartAndTargets(&fleet, TestSeed(seed)));
    for (const bool in_order : {false, true}) {
      const PlanOptions options{.lead_apart = in_order, .clock_error = 0.04};
      auto plan = MakePlan(fleet.request(), options);
      ASSERT_TRUE(plan) << plan.error().text;
      Stopped stopped(fleet, std::move(*plan), options);
      Rng rng = Rng::Stream(TestSeed(seed), "stop pairs");
      StopEveryFollower(&stopped, &rng, 160);
    }
  }
}

}  // namespace
}  // namespace focalfleet
