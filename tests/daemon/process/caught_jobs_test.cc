#include "daemon/process/caught_jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <new>

#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// A plan of a small fleet as the planner's thread gets it.
class PlanCaughtTest : public testing::Test {
 protected:
  PlanCaughtTest() {
    test::DrawStartAndTargets(&fleet_, test::Seed(1));
    work_.job = {.job = 7,
                 .start = fleet_.start,
                 .targets = fleet_.targets,
                 .frozen = fleet_.frozen,
                 .options = {}};
    work_.drives = fleet_.drives;
  }

  PlanDone Plan(std::chrono::nanoseconds within = kPlanWithin) {
    return PlanCaught(work_, fleet_.layout, ending_, alive_, within);
  }

  test::PlanningFleet fleet_ = test::HexFleet(19);
  PlannerWork work_;
  std::atomic<bool> ending_ = false;
  std::function<void()> alive_ = [] {};
};

TEST_F(PlanCaughtTest, IsThePlan) { EXPECT_TRUE(Plan().plan); }

TEST_F(PlanCaughtTest, ThatTakesTooLongSaysSo) {
  const PlanDone done = Plan(std::chrono::nanoseconds(-1));
  EXPECT_EQ(done.job, 7u);
  ASSERT_FALSE(done.plan);
  EXPECT_EQ(done.plan.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(done.plan.error().text, HasSubstr("no plan within 0 minutes"));
}

TEST_F(PlanCaughtTest, ThatIsGivenUpForAConfigurationSaysSo) {
  work_.job.purpose = PlanPurpose::kPreview;
  work_.given_up = std::make_shared<std::atomic<bool>>(true);
  const PlanDone done = Plan();
  EXPECT_EQ(done.purpose, PlanPurpose::kPreview);
  ASSERT_FALSE(done.plan);
  EXPECT_EQ(done.plan.error().code, ErrorCode::kRefused);
  EXPECT_THAT(done.plan.error().text, HasSubstr("is planned first"));
}

TEST_F(PlanCaughtTest, ThatThrowsIsAnError) {
  alive_ = [] { throw std::bad_alloc(); };
  const PlanDone done = Plan();
  ASSERT_FALSE(done.plan);
  EXPECT_THAT(done.plan.error().text, HasSubstr("the planner failed: "));
}

}  // namespace
}  // namespace focalfleet
