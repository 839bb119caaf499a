#include "daemon/page/kept_plans.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/scratch_folder.h"

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

/// A motion of no unit, which differs by the end of its last row.
std::string MotionEndingAt(float end_s) {
  std::string bytes(16, '\0');
  bytes[0] = 12;
  bytes[4] = 1;
  std::memcpy(bytes.data() + 12, &end_s, sizeof end_s);
  return bytes;
}

TEST(KeptPlans, OutlastTheDaemonInAFolder) {
  const test::ScratchFolder scratch;
  const std::string folder = scratch / "db.plans";
  {
    KeptPlans plans;
    plans.KeepIn(folder);
    plans.Put(9, MotionEndingAt(1));
    plans.Put(10, MotionEndingAt(2));
    plans.Put(10, MotionEndingAt(3));
  }
  KeptPlans plans;
  plans.KeepIn(folder);
  ASSERT_EQ(plans.Of(10).size(), 2u);
  EXPECT_EQ(*plans.Of(10)[0], MotionEndingAt(2));
  EXPECT_EQ(*plans.Of(10)[1], MotionEndingAt(3));
  // The configuration goes on: its next plan comes after those before.
  plans.Put(10, MotionEndingAt(4));
  KeptPlans again;
  again.KeepIn(folder);
  ASSERT_EQ(again.Of(10).size(), 3u);
  EXPECT_EQ(*again.Of(10)[2], MotionEndingAt(4));
  EXPECT_EQ(again.Of(9).size(), 1u);
}

TEST(KeptPlans, AFileThatWasTornIsNoMotion) {
  const test::ScratchFolder scratch;
  const std::string folder = scratch / "db.plans";
  KeptPlans plans;
  plans.KeepIn(folder);
  plans.Put(3, MotionEndingAt(1));
  std::filesystem::resize_file(folder + "/3.1.motion", 15);
  std::ofstream(folder + "/notes.txt") << "not of this program";
  KeptPlans after;
  after.KeepIn(folder);
  EXPECT_TRUE(after.Of(3).empty());
  EXPECT_TRUE(std::filesystem::exists(folder + "/notes.txt"));
}

TEST(KeptPlans, FilesGoWithTheirPlans) {
  const test::ScratchFolder scratch;
  const std::string folder = scratch / "db.plans";
  KeptPlans plans(40);
  plans.KeepIn(folder);
  for (std::uint64_t id = 1; id <= 4; ++id) plans.Put(id, MotionEndingAt(1));
  EXPECT_FALSE(std::filesystem::exists(folder + "/2.1.motion"));
  EXPECT_TRUE(std::filesystem::exists(folder + "/3.1.motion"));
  KeptPlans smaller(20);
  smaller.KeepIn(folder);
  EXPECT_TRUE(smaller.Of(3).empty());
  EXPECT_EQ(smaller.Of(4).size(), 1u);
}

TEST(KeptPlans, WithoutADiskTheyAreInMemory) {
  KeptPlans plans;
  plans.KeepIn("/proc/no/such/folder");
  plans.Put(1, MotionEndingAt(1));
  EXPECT_EQ(plans.Of(1).size(), 1u);
}

}  // namespace
}  // namespace focalfleet
