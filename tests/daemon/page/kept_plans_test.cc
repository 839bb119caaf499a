#include "daemon/page/kept_plans.h"

#include <gtest/gtest.h>

#include <string>

namespace focalfleet {
namespace {

TEST(KeptPlans, AConfigurationHasItsPlansInTheirOrder) {
  KeptPlans plans;
  plans.Put(7, "first");
  plans.Put(8, "other");
  plans.Put(7, "second");
  const auto found = plans.Of(7);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(*found[0], "first");
  EXPECT_EQ(*found[1], "second");
  EXPECT_TRUE(plans.Of(9).empty());
}

TEST(KeptPlans, TheOldestGoWhereTheBoundOfBytesIsReached) {
  KeptPlans plans(100);
  for (std::uint64_t id = 1; id <= 5; ++id) plans.Put(id, std::string(30, 'x'));
  EXPECT_TRUE(plans.Of(1).empty());
  EXPECT_TRUE(plans.Of(2).empty());
  for (std::uint64_t id = 3; id <= 5; ++id) EXPECT_EQ(plans.Of(id).size(), 1u) << id;
}

TEST(KeptPlans, APlanThatDoesNotFitAloneTakesNothingAway) {
  KeptPlans plans(100);
  plans.Put(1, std::string(90, 'x'));
  plans.Put(2, std::string(101, 'x'));
  EXPECT_EQ(plans.Of(1).size(), 1u);
  EXPECT_TRUE(plans.Of(2).empty());
  plans.PutPreview(3, std::string(101, 'x'));
  EXPECT_EQ(plans.Preview(3), nullptr);
}

TEST(KeptPlans, OnlyTheLastPreviewIsKeptAndOnlyUnderItsNumber) {
  KeptPlans plans;
  EXPECT_EQ(plans.Preview(0), nullptr);
  plans.PutPreview(4, "a");
  plans.PutPreview(5, "b");
  EXPECT_EQ(plans.Preview(4), nullptr);
  ASSERT_NE(plans.Preview(5), nullptr);
  EXPECT_EQ(*plans.Preview(5), "b");
  EXPECT_TRUE(plans.Of(5).empty()) << "a preview is no configuration";
}

TEST(KeptPlans, AMotionThatSomebodyReadsOutlivesItsPlace) {
  KeptPlans plans(10);
  plans.Put(1, "12345678");
  const auto held = plans.Of(1);
  plans.Put(2, "12345678");
  EXPECT_TRUE(plans.Of(1).empty());
  EXPECT_EQ(*held.front(), "12345678");
}

}  // namespace
}  // namespace focalfleet
