// A plan that is abandoned after any number of questions.
#include "fleet/plan/abandoned.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <optional>

#include "fleet/plan/job.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::DrawStartAndTargets;
using test::FleetOf;
using test::HexFleet;
using test::PlanningFleet;
using test::Seed;
using ::testing::HasSubstr;

/// The answer to the planner's question: false for so many times.
struct Asked {
  std::size_t times = 0;
  std::optional<std::size_t> wanted_for;  // empty: for ever

  [[nodiscard]] Abandoned question() {
    return [this] {
      ++times;
      return wanted_for && times > *wanted_for;
    };
  }
};

void ExpectSamePlan(const Plan& a, const Plan& b) {
  EXPECT_EQ(a.unserved.size(), b.unserved.size());
  EXPECT_EQ(a.makespan_s, b.makespan_s);
  ASSERT_EQ(a.moves.size(), b.moves.size());
  for (std::size_t m = 0; m < a.moves.size(); ++m)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      EXPECT_TRUE(std::ranges::equal(a.moves[m].path[k].segments(), b.moves[m].path[k].segments()));
}

// Fleets that are planned all at once, by an order, and so crowded that hardly any unit is served.
std::vector<PlanningFleet> Fleets() {
  std::vector<PlanningFleet> fleets;
  fleets.push_back(HexFleet(127));
  fleets.push_back(FleetOf(MakeHexLayout(SdssLike(127))));
  fleets.push_back(
      FleetOf(MakeHexLayout({.count = 61, .pitch_mm = 14, .theta_arm_mm = 9, .phi_arm_mm = 10})));
  for (PlanningFleet& fleet : fleets) DrawStartAndTargets(&fleet, Seed(0));
  return fleets;
}

TEST(Abandoned, AskingChangesNothing) {
  for (const PlanningFleet& fleet : Fleets()) {
    Asked asked;
    const auto plain = MakePlan(fleet.request(), {});
    const auto watched = MakePlan(fleet.request(), {.abandoned = asked.question()});
    ASSERT_TRUE(plain && watched);
    EXPECT_GT(asked.times, 0u);
    ExpectSamePlan(*plain, *watched);
  }
}

TEST(Abandoned, APlanEndsSoonWheneverItIsGivenUp) {
  for (const PlanningFleet& fleet : Fleets()) {
    Asked whole;
    ASSERT_TRUE(MakePlan(fleet.request(), {.abandoned = whole.question()}));
    for (const std::size_t sixteenth : {0u, 1u, 4u, 8u, 12u, 15u}) {
      Asked asked{.wanted_for = whole.times * sixteenth / 16};
      const auto plan = MakePlan(fleet.request(), {.abandoned = asked.question()});
      if (plan) continue;  // the last pieces were in place already
      EXPECT_EQ(plan.error().code, ErrorCode::kUnavailable) << plan.error().text;
      EXPECT_THAT(plan.error().text, HasSubstr("nobody wants the plan any more"));
      EXPECT_LT(asked.times - *asked.wanted_for, 10 * fleet.layout.size())
          << "no search begins any more: each unit is passed over a few times at most";
    }
    Asked at_once{.wanted_for = 0};
    EXPECT_FALSE(MakePlan(fleet.request(), {.abandoned = at_once.question()}));
  }
}

TEST(Abandoned, AJobReportsItAndItsRunningPlanIsKeptWithoutTheQuestion) {
  PlanningFleet fleet = HexFleet(19);
  DrawStartAndTargets(&fleet, Seed(1));
  PlanJob job{.job = 7,
              .start = fleet.start,
              .targets = fleet.targets,
              .frozen = fleet.frozen,
              .options = {}};
  Asked at_once{.wanted_for = 0};
  const PlanDone given_up = RunPlanJob(job, fleet.layout, fleet.drives, at_once.question());
  EXPECT_EQ(given_up.job, 7u);
  ASSERT_FALSE(given_up.plan);
  EXPECT_EQ(given_up.plan.error().code, ErrorCode::kUnavailable);

  Asked asked;
  const PlanDone done = RunPlanJob(job, fleet.layout, fleet.drives, asked.question());
  ASSERT_TRUE(done.plan);
  ASSERT_NE(done.running, nullptr);
  const std::size_t before = asked.times;
  static_cast<void>(done.running->Replan(
      {.unit = {0}, .from = PlaceOf(fleet.start[0]), .to = *fleet.targets[0], .start_s = 1}, {}));
  EXPECT_EQ(asked.times, before);
}

/// A search that is cut short while it improves its plan ends with another plan than one that is
/// not, and a journal makes it again.
TEST(Abandoned, APlanThatWasCutShortIsMadeAgainByItsLook) {
  std::size_t later = 0;
  for (const std::uint64_t seed : {0u, 1u, 2u}) {
    PlanningFleet fleet = FleetOf(MakeHexLayout(SdssLike(37)));
    DrawStartAndTargets(&fleet, Seed(seed));
    const PlanJob job{.job = 7,
                      .start = fleet.start,
                      .targets = fleet.targets,
                      .frozen = fleet.frozen,
                      .options = {}};
    Asked uncut;
    const PlanDone whole = RunPlanJob(job, fleet.layout, fleet.drives, uncut.question());
    ASSERT_TRUE(whole.plan);
    EXPECT_EQ(whole.given_up_at_look, 0u);
    for (std::size_t percent = 10; percent < 100; percent += 10) {
      Asked cut{.wanted_for = uncut.times * percent / 100};
      const PlanDone first = RunPlanJob(job, fleet.layout, fleet.drives, cut.question());
      EXPECT_EQ(first.given_up_at_look, *cut.wanted_for + 1);
      Asked again{.wanted_for = first.given_up_at_look - 1};
      const PlanDone second = RunPlanJob(job, fleet.layout, fleet.drives, again.question());
      ASSERT_EQ(first.plan.has_value(), second.plan.has_value()) << percent;
      if (!first.plan) continue;
      ExpectSamePlan(*first.plan, *second.plan);
      later += first.plan->makespan_s > whole.plan->makespan_s ? 1u : 0u;
    }
  }
  EXPECT_GT(later, 0u) << "no cut came while a plan was improved";
}

}  // namespace
}  // namespace focalfleet
