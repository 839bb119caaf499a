// In these tests a unit ends by itself in mid-motion. Units that would come where it may stand are
// stopped within the notice that the plan was made with, and no other unit is stopped.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "fleet/coordinate/stall_detection.h"
#include "protocol/base/rng.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::ExpectStoreTellsTheTruth;
using test::InProcessFleet;
using test::TestSeed;

constexpr double kSlackS = 1.2;  // both units still move for this long

struct Led {
  PositionerIndex leader;
  UnitPlan::Follower follower;
};

class Noticed : public ::testing::Test {
 protected:
  /// Begins a configuration; it has just started.
  void Begin(std::uint64_t seed) {
    fleet_.emplace(InProcessFleet::Options{.count = 61, .units_per_bus = 20, .seed = seed});
    fleet_->ApplyRandom(seed + 1000);
    ASSERT_TRUE(fleet_->RunUntil(
        [&] { return fleet_->coordinator().configuration().state == ConfigurationState::kMoving; },
        Seconds(60)));
    started_ = fleet_->coordinator().configuration().started;
    pairs_.clear();
    for (const UnitPlan& move : fleet_->planner.last_plan().moves)
      for (const UnitPlan::Follower& follower : move.followers)
        pairs_.push_back({move.unit, follower});
  }
  [[nodiscard]] double EndOf(PositionerIndex i) const {
    for (const UnitPlan& move : fleet_->planner.last_plan().moves)
      if (move.unit == i) return focalfleet::EndOf(move, UnitDrive{});
    return 0;
  }
  /// A pair, and a time between `low_s(pair)` and `high_s(pair)` at which both will still move for
  /// long.
  template <class Low, class High>
  std::optional<std::pair<Led, double>> Draw(Rng* rng, const Low& low_s, const High& high_s) {
    std::vector<std::pair<Led, double>> found;
    for (const Led& pair : pairs_) {
      const double low = std::max(0.1, low_s(pair));
      const double high =
          std::min({high_s(pair), EndOf(pair.leader) - kSlackS, EndOf(pair.follower.unit) - 3});
      if (low < high) found.emplace_back(pair, rng->Uniform(low, high));
    }
    if (found.empty()) return std::nullopt;
    return found[rng->Below(found.size())];
  }
  void RunTo(double t_s) { fleet_->Run(started_ + Seconds(t_s) - fleet_->now()); }
  [[nodiscard]] bool Moves(PositionerIndex i) const {
    return fleet_->world().Truth(i.value).state == UnitState::kMoving;
  }

  mutable std::optional<InProcessFleet> fleet_;
  HostInstant started_;
  std::vector<Led> pairs_;
};

TEST_F(Noticed, ThoseThatFollowAreStoppedInTime) {
  const double notice_s = StallDetectionOf({}).notice.seconds();
  double longest_s = 0;
  int draws = 0;
  for (std::uint64_t k = 0; k < 30; ++k) {
    const std::uint64_t seed = TestSeed(100 + k);
    FOCALFLEET_TRACE_SEED(seed);
    ASSERT_NO_FATAL_FAILURE(Begin(seed));
    Rng rng = Rng::Stream(seed, "noticed");
    const auto drawn = Draw(
        &rng, [](const Led& p) { return p.follower.since_s; },
        [](const Led& p) { return p.follower.left_s; });
    if (!drawn) continue;
    const auto& [pair, t_s] = *drawn;
    RunTo(t_s);
    if (!Moves(pair.leader) || !Moves(pair.follower.unit)) continue;
    ++draws;
    const UnitId leader = fleet_->id(pair.leader.value);
    const HostInstant ended = fleet_->now();
    if (k % 3 == 0) fleet_->world().disturb().PowerCut(leader);
    if (k % 3 == 1)
      fleet_->world().disturb().faults(leader)->silent = true;  // moves on without any report
    if (k % 3 == 2) {
      fleet_->world().disturb().PowerCut(leader);
      fleet_->Run(Milliseconds(30));
      fleet_->world().disturb().PowerOn(leader);
    }
    EXPECT_TRUE(fleet_->RunUntil([&] { return !Moves(pair.follower.unit); }, Seconds(3)))
        << "unit " << fleet_->id(pair.follower.unit.value).value << " was not stopped";
    const double took_s = (fleet_->now() - ended).seconds();
    longest_s = std::max(longest_s, took_s);
    EXPECT_LE(took_s, notice_s) << "unit " << leader.value << " ended at " << t_s << " s";
  }
  std::printf("%d ends, followers stopped within %.3f s at most, notice %.3f s\n", draws, longest_s,
              notice_s);
  EXPECT_GT(draws, 15);
}

TEST_F(Noticed, ThoseThatFollowOneThatNeverBeganAreStoppedInTime) {
  const double notice_s = StallDetectionOf({}).notice.seconds();
  double longest_s = 0;
  int draws = 0;
  for (std::uint64_t k = 0; k < 24; ++k) {
    const std::uint64_t seed = TestSeed(150 + k);
    FOCALFLEET_TRACE_SEED(seed);
    ASSERT_NO_FATAL_FAILURE(Begin(seed));
    const auto stands_in_the_way = [&](const Led& pair) {
      return pair.follower.since_s < 0.01 && EndOf(pair.follower.unit) > 3;
    };
    const auto pair = std::find_if(pairs_.begin(), pairs_.end(), stands_in_the_way);
    if (pair == pairs_.end()) continue;
    ++draws;
    // The unit is armed, and hears no start.
    fleet_->world().disturb().faults(fleet_->id(pair->leader.value))->deaf = true;
    RunTo(0.1);
    fleet_->world().disturb().faults(fleet_->id(pair->leader.value))->deaf = false;
    ASSERT_FALSE(Moves(pair->leader));
    ASSERT_TRUE(Moves(pair->follower.unit));
    EXPECT_TRUE(fleet_->RunUntil([&] { return !Moves(pair->follower.unit); }, Seconds(3)));
    longest_s = std::max(longest_s, (fleet_->now() - started_).seconds());
  }
  std::printf("%d that never began, followers stopped within %.3f s at most\n", draws, longest_s);
  EXPECT_LE(longest_s, notice_s);
  EXPECT_GT(draws, 8);
}

/// Frames are lost as well: a question or two, or the stop itself.
TEST_F(Noticed, InTimeAlsoWhereFramesAreLost) {
  double longest_s = 0;
  int draws = 0;
  for (std::uint64_t k = 0; k < 24; ++k) {
    const std::uint64_t seed = TestSeed(200 + k);
    FOCALFLEET_TRACE_SEED(seed);
    ASSERT_NO_FATAL_FAILURE(Begin(seed));
    for (const BusId bus : fleet_->layout().buses())
      fleet_->world().disturb().faults(bus)->drop = 0.02;
    Rng rng = Rng::Stream(seed, "noticed");
    const auto drawn = Draw(
        &rng, [](const Led& p) { return p.follower.since_s; },
        [](const Led& p) { return p.follower.left_s; });
    if (!drawn) continue;
    const auto& [pair, t_s] = *drawn;
    RunTo(t_s);
    if (!Moves(pair.leader) || !Moves(pair.follower.unit)) continue;
    ++draws;
    const HostInstant ended = fleet_->now();
    fleet_->world().disturb().PowerCut(fleet_->id(pair.leader.value));
    EXPECT_TRUE(fleet_->RunUntil([&] { return !Moves(pair.follower.unit); }, Seconds(3)));
    longest_s = std::max(longest_s, (fleet_->now() - ended).seconds());
  }
  std::printf("%d ends, followers stopped within %.3f s at most\n", draws, longest_s);
  EXPECT_LE(longest_s, StallDetectionOf({}).notice.seconds());
  EXPECT_GT(draws, 12);
}

/// A unit that has passed already, or does not come where the other stands now, goes on.
TEST_F(Noticed, OthersGoOn) {
  int left = 0;
  int not_yet = 0;
  for (std::uint64_t k = 0; k < 40; ++k) {
    const std::uint64_t seed = TestSeed(300 + k);
    FOCALFLEET_TRACE_SEED(seed);
    ASSERT_NO_FATAL_FAILURE(Begin(seed));
    Rng rng = Rng::Stream(seed, "noticed");
    const bool late = k % 2 == 0;
    // A unit that has reported that it moves is asked again after a poll period at most.
    const auto drawn = late ? Draw(
                                  &rng, [](const Led& p) { return p.follower.left_s + 1.1; },
                                  [](const Led&) { return 1e9; })
                            : Draw(
                                  &rng, [](const Led&) { return 2.0; },
                                  [](const Led& p) { return p.follower.since_s - 1.2; });
    if (!drawn) continue;
    const auto& [pair, t_s] = *drawn;
    // The two must not follow each other through a third unit either.
    const auto follows = [&](PositionerIndex a, PositionerIndex b) {
      return std::any_of(pairs_.begin(), pairs_.end(), [&](const Led& other) {
        return other.leader == a && other.follower.unit == b;
      });
    };
    const PositionerIndex leader = pair.leader;
    const PositionerIndex follower = pair.follower.unit;
    if (std::any_of(pairs_.begin(), pairs_.end(), [&](const Led& other) {
          return other.leader == leader && follows(other.follower.unit, follower);
        }))
      continue;
    RunTo(t_s);
    if (!Moves(leader) || !Moves(follower)) continue;
    ++(late ? left : not_yet);
    fleet_->world().disturb().PowerCut(fleet_->id(leader.value));
    fleet_->Run(Milliseconds(30));
    fleet_->world().disturb().PowerOn(fleet_->id(leader.value));
    RunTo(EndOf(follower) - 0.2);
    EXPECT_TRUE(Moves(follower)) << "unit " << fleet_->id(leader.value).value << " ended at " << t_s
                                 << " s, since " << pair.follower.since_s << " left "
                                 << pair.follower.left_s;
  }
  std::printf("%d followers went on that had passed, %d that do not come where it stands\n", left,
              not_yet);
  EXPECT_GT(left, 3);
  EXPECT_GT(not_yet, 2);
}

TEST(StallDetection, AsksLittleOfTheBus) {
  InProcessFleet fleet({.count = 217, .units_per_bus = 100, .seed = 4});
  fleet.ApplyRandom(5);
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  fleet.Run(Seconds(3));
  const BusView before = fleet.coordinator().bus(fleet.layout().buses()[0]);
  fleet.Run(Seconds(5));
  const BusView after = fleet.coordinator().bus(fleet.layout().buses()[0]);
  const double load = static_cast<double>(after.bits - before.bits) / 5e6;
  std::printf("load of a bus with 100 moving units: %.2f %%\n", 100 * load);
  EXPECT_GT(load, 0.01);
  EXPECT_LT(load, 0.06);
}

TEST(StallDetection, IsNoLongerThanAskedForUnlessAnswersAreSlow) {
  for (const int notice_ms : {1000, 2000, 5000}) {
    const StallDetection stall_detection = StallDetectionOf({.notice = Milliseconds(notice_ms)});
    EXPECT_EQ(stall_detection.notice, Milliseconds(notice_ms));
    EXPECT_LT(stall_detection.poll + stall_detection.suspicion, stall_detection.notice);
  }
  const StallDetection slow =
      StallDetectionOf({.reply_wait = Milliseconds(200), .notice = Milliseconds(1000)});
  EXPECT_GT(slow.notice, Milliseconds(1000));
  EXPECT_GE(slow.suspicion, Milliseconds(600));
  EXPECT_LT(slow.poll + slow.suspicion, slow.notice);
}

// The host may be held up between the start signal's instant and its frame on the bus. A unit that
// reports meanwhile that it is armed has not failed to begin.
TEST(LateStart, NobodyIsGivenUpThatOnlyStartsLate) {
  const std::uint64_t seed = TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  InProcessFleet fleet(
      {.count = 61, .units_per_bus = 20, .seed = seed, .commit_delay = Milliseconds(400)});
  fleet.ApplyRandom(seed);
  const auto each_bus = [&](const sim::BusFaults& faults) {
    for (const BusId bus : fleet.layout().buses()) *fleet.world().disturb().faults(bus) = faults;
  };
  const auto all_armed = [&] {
    for (std::uint32_t i = 0; i < fleet.layout().size(); ++i)
      if (fleet.coordinator().unit({i}).phase != UnitPhase::kArmed) return false;
    return true;
  };
  ASSERT_TRUE(fleet.RunUntil(all_armed, Seconds(60)));
  // The first start frame comes 350 ms late, its repeats are lost.
  each_bus({.late = 1, .late_by = Milliseconds(350)});
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(1)));
  each_bus({.drop = 1});
  fleet.Run(Milliseconds(240));
  each_bus({});
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 61u);
  EXPECT_EQ(fleet.coordinator().configuration().round, 1u);
  ExpectStoreTellsTheTruth(fleet, "after a late start");
}

}  // namespace
}  // namespace focalfleet
