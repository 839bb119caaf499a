// Whole focal planes that are stopped in mid-motion: all at once, one unit, one bus. The public
// plan and the independent checker alone are the judges.
//
// Every unit runs by a clock of its own within the tolerance that the plan allows for, half of them
// at its corners. All stops are at true times. A unit that ends by itself at t has its followers
// stopped no later than t + notice, and theirs in turn, as far as `since_s` and `left_s` say that
// they are concerned. Then no pair may be unclear at any time. The exceptions are those that
// Plan::unnoticed names, and only as far as it says.
//
// The plan checker has tested the whole plan, so each draw is walked from just before the first
// stop. Pairs of which neither was stopped are as planned, so only stopped units and their
// neighbours are looked at. A test proves that this finds the same as a look at all units from the
// start.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/stopped.h"

namespace focalfleet {
namespace {

using test::ExpectANewPlan;
using test::kBeforeS;
using test::kNever;
using test::kReplanEvery;
using test::Stopped;
using test::StopSafety;
using test::Tally;
using test::UnclearPairs;
using test::Units;
using test::UnnoticedPairs;

constexpr int kInstants = 100;

TEST_P(StopSafety, FewPairsAreUnnoticed) {
  FOCALFLEET_TRACE_SEED(seed_);
  const Plan& plan = fleet_->plan();
  std::size_t followers = 0;
  for (const UnitPlan& move : plan.moves) followers += move.followers.size();
  const double share = static_cast<double>(UnnoticedPairs(fleet_->plan())) / plan.crossings;
  std::printf(
      "FOCALFLEET_SEED=%llu makespan %.2f s bound %.2f s crossings %u followers %zu unnoticed %zu "
      "entries %zu pairs share %.2f %%\n",
      static_cast<unsigned long long>(seed_), plan.makespan_s, plan.bound_s, plan.crossings,
      followers, plan.unnoticed.size(), UnnoticedPairs(fleet_->plan()), share * 100);
  EXPECT_GT(plan.crossings, 0u);
  EXPECT_LE(share, 0.02);
}

TEST_P(StopSafety, AllStopAtOnce) {
  constexpr double kStopSkewS = 0.020;
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop all");
  Tally at_once;
  Tally skewed;
  int late = 0;
  for (int draw = 0; draw < kInstants; ++draw) {
    const double t_s = DrawInstant(&rng);
    fleet_->DrawClocks(&rng);
    for (const bool with_skew : {false, true}) {
      for (const std::uint32_t i : fleet_->AllUnits())
        fleet_->StopAt(i, t_s + (with_skew ? rng.Uniform(-kStopSkewS, kStopSkewS) : 0));
      (with_skew ? skewed : at_once).Count(*fleet_, 0, std::max(t_s - kBeforeS, -kBeforeS));
    }
    if (draw % kReplanEvery == 0) ExpectANewPlan(*fleet_, t_s);
    // The units do not stop at once: every other unit goes on for long.
    if (draw < 3) {
      for (const std::uint32_t i : fleet_->AllUnits())
        if (i % 2 == 0) fleet_->StopAt(i, t_s + 10);
      late += static_cast<int>(fleet_->Check(fleet_->AllUnits(), t_s).pairs.size());
    }
  }
  at_once.Print("all at once");
  skewed.Print("all within the skew");
  EXPECT_EQ(at_once.unclear, 0);
  EXPECT_EQ(at_once.unnoticed, 0);
  EXPECT_EQ(skewed.unclear, 0);
  EXPECT_GT(late, 0) << "no stop matters, the test proves nothing";
}

/// Repeats one way to stop: with followers stopped as late as is allowed, with followers stopped
/// some time before, and with no follower stopped.
template <class First>
void StopAgainAndAgain(Stopped* fleet, Rng* rng, const First& first) {
  Tally latest;
  Tally earlier;
  Tally ignored;
  for (int draw = 0; draw < kInstants; ++draw) {
    fleet->DrawClocks(rng);
    const double t_s = rng->Uniform(0, fleet->plan().makespan_s);
    const Units ends = first(t_s);
    if (ends.empty()) continue;
    const double notice_s = fleet->options().notice_s;
    for (Tally* tally : {&latest, &earlier, &ignored}) {
      fleet->GoOn();
      for (const std::uint32_t i : ends) fleet->StopAt(i, t_s);
      int followers = 0;
      if (tally == &latest)
        followers = fleet->StopFollowers([&](double) { return t_s + notice_s; });
      if (tally == &earlier)
        followers = fleet->StopFollowers(
            [&](double ended_s) { return rng->Uniform(ended_s, t_s + notice_s); });
      const bool silent = tally == &ignored;
      if (silent) {
        ++ignored.draws;
        ignored.unclear += static_cast<int>(
            fleet->Check(fleet->StoppedAndNeighbours(), t_s - kBeforeS).pairs.size());
      } else {
        tally->Count(*fleet, followers, t_s - kBeforeS);
        if (tally == &latest && draw % kReplanEvery == 0) ExpectANewPlan(*fleet, t_s);
      }
    }
  }
  latest.Print("followers at the last moment");
  earlier.Print("followers some time before");
  std::printf("nobody is stopped: %d unclear pairs in %d draws\n", ignored.unclear, ignored.draws);
  EXPECT_GT(latest.draws, kInstants / 2);
  EXPECT_EQ(latest.unclear, 0);
  EXPECT_EQ(earlier.unclear, 0);
  EXPECT_GT(ignored.unclear, 0) << "the stops made no difference, the test proves nothing";
}

TEST_P(StopSafety, OneUnitEndsEarly) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop one");
  StopAgainAndAgain(&*fleet_, &rng, [&](double t_s) {
    Units moving;
    for (const std::uint32_t i : fleet_->AllUnits())
      if (fleet_->Moves(i, t_s)) moving.push_back(i);
    return moving.empty() ? Units{} : Units{moving[rng.Below(moving.size())]};
  });
}

TEST_P(StopSafety, ABusEndsEarly) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop bus");
  StopAgainAndAgain(&*fleet_, &rng, [&](double t_s) {
    const auto buses = fleet_->fleet().layout.buses();
    const BusId bus = buses[rng.Below(buses.size())];
    Units moving;
    for (const std::uint32_t i : fleet_->AllUnits())
      if (fleet_->fleet().layout.unit({i}).bus == bus && fleet_->Moves(i, t_s)) moving.push_back(i);
    return moving;
  });
}

INSTANTIATE_TEST_SUITE_P(Seeds, StopSafety, ::testing::Range(1, 4));

class StopSafetyOnce : public StopSafety {};

// Followers are ignored, so that unclear pairs exist.
TEST_P(StopSafetyOnce, ALookAtTheNeighboursFindsWhatALookAtAllFinds) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "restricted");
  const auto buses = fleet_->fleet().layout.buses();
  std::size_t found = 0;
  for (int draw = 0; draw < 3; ++draw) {
    fleet_->DrawClocks(&rng);
    fleet_->GoOn();
    const double t_s = rng.Uniform(0.2, 0.8) * fleet_->plan().makespan_s;
    const BusId bus = buses[rng.Below(buses.size())];
    for (const std::uint32_t i : fleet_->AllUnits())
      if (fleet_->fleet().layout.unit({i}).bus == bus) fleet_->StopAt(i, t_s);
    const UnclearPairs near = fleet_->Check(fleet_->StoppedAndNeighbours(), t_s - kBeforeS);
    const UnclearPairs all = fleet_->Check(fleet_->AllUnits(), -kBeforeS);
    EXPECT_EQ(near.pairs, all.pairs) << near.text << "---\n" << all.text;
    found += all.pairs.size();
  }
  std::printf("the same %zu unclear pairs by both looks\n", found);
  EXPECT_GT(found, 0u) << "nothing was found, the test proves nothing";
}

INSTANTIATE_TEST_SUITE_P(Seeds, StopSafetyOnce, ::testing::Values(1));

// In stages a unit may halt unseen, with both axes, and no unit need be stopped before the next
// stage.
class StopSafetyInStages : public StopSafety {
 protected:
  [[nodiscard]] PlanOptions Options() const override { return {.stall_tolerant = true}; }
  /// The time when any unit may begin the stage after the one of `t_s`, whatever its clock; never
  /// after the last. Units: s.
  [[nodiscard]] double NextStage(double t_s) const {
    const auto& stages = fleet_->plan().stages_s;
    const auto next = std::upper_bound(stages.begin(), stages.end(), t_s);
    const PlanOptions& options = fleet_->options();
    return next == stages.end() ? kNever : *next / (1 + options.clock_error) - options.start_skew_s;
  }
};

TEST_P(StopSafetyInStages, AnUnseenHaltTouchesNoOtherUnit) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "halts");
  const Plan& plan = fleet_->plan();
  Tally tally;
  int without_stages = 0;
  for (int draw = 0; draw < kInstants; ++draw) {
    fleet_->DrawClocks(&rng);
    const double t_s = DrawInstant(&rng);
    for (const bool in_stages : {true, false}) {
      fleet_->GoOn();
      if (in_stages)
        for (const std::uint32_t i : fleet_->AllUnits()) fleet_->StopAt(i, NextStage(t_s));
      int halted = 0;
      for (const std::uint32_t i : fleet_->AllUnits()) {
        if (i % 40 != static_cast<std::uint32_t>(draw % 40) || !fleet_->Moves(i, t_s)) continue;
        fleet_->StopAt(i, t_s);
        ++halted;
      }
      if (halted == 0) break;
      if (in_stages)
        tally.Count(*fleet_, halted, t_s - kBeforeS);
      else
        without_stages += static_cast<int>(
            fleet_->Check(fleet_->StoppedAndNeighbours(), t_s - kBeforeS).pairs.size());
    }
  }
  std::printf("%zu stages, makespan %.2f s, bound %.2f s; ", plan.stages_s.size(), plan.makespan_s,
              plan.bound_s);
  tally.Print("one in forty halts");
  EXPECT_GT(tally.draws, kInstants / 2);
  EXPECT_EQ(tally.unclear + tally.unnoticed, 0);
  EXPECT_GT(without_stages, 0) << "the stages made no difference, the test proves nothing";
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopSafetyInStages, ::testing::Range(1, 3));

}  // namespace
}  // namespace focalfleet
