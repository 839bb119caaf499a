#include "daemon/doctor/identity.h"

#include <gtest/gtest.h>

namespace focalfleet::doctor {
namespace {

TEST(May, GoesByOwnerThenGroupThenOthers) {
  const Identity user{.uid = 7, .groups = {70, 71}, .name = "u"};
  const auto may = [&](std::uint32_t uid, std::uint32_t gid, std::uint32_t mode) {
    const FileFacts file{
        .path = "f", .trouble = "", .uid = uid, .gid = gid, .mode = mode, .owner = "", .group = ""};
    return May(user, file, Access::kWrite);
  };
  EXPECT_TRUE(may(7, 0, 0200));
  EXPECT_FALSE(may(7, 70, 0022)) << "the owner's bits alone count for the owner";
  EXPECT_TRUE(may(0, 71, 0020));
  EXPECT_FALSE(may(0, 71, 0202)) << "the group's bits alone count for its members";
  EXPECT_TRUE(may(0, 0, 0002));
  EXPECT_FALSE(may(0, 0, 0220));
  const FileFacts closed{};
  EXPECT_TRUE(May({.uid = 0, .groups = {}, .name = "root"}, closed, Access::kWrite));
}

}  // namespace
}  // namespace focalfleet::doctor
