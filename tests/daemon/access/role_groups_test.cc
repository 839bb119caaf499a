#include "daemon/access/role_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

constexpr std::uint32_t kDaemon = 990;

Peer Member(std::uint32_t gid, std::vector<std::uint32_t> groups = {}) {
  return {.pid = 1, .uid = 1000, .gid = gid, .groups = std::move(groups)};
}

TEST(RoleGroups, AreNotInUseWhereNoGroupIsNamed) {
  const auto groups = RoleGroups::Find({}, kDaemon);
  ASSERT_TRUE(groups);
  EXPECT_FALSE(groups->in_use());
  EXPECT_EQ(groups->RoleOf(Member(5)), Role::kEngineer);
  EXPECT_EQ(groups->RoleOf(std::nullopt), Role::kEngineer);
}

TEST(RoleGroups, GiveTheHighestRoleOfAllGroups) {
  const auto groups = RoleGroups::Find(
      {.viewers = {"2001", "2004"}, .operators = {"2002"}, .engineers = {"2003"}}, kDaemon);
  ASSERT_TRUE(groups);
  EXPECT_EQ(groups->RoleOf(Member(5)), Role::kNone);
  EXPECT_EQ(groups->RoleOf(Member(2001)), Role::kViewer);
  EXPECT_EQ(groups->RoleOf(Member(5, {6, 2004})), Role::kViewer);
  EXPECT_EQ(groups->RoleOf(Member(2001, {2002})), Role::kOperator);
  EXPECT_EQ(groups->RoleOf(Member(2003, {2001, 2002})), Role::kEngineer);
  EXPECT_EQ(groups->RoleOf(std::nullopt), Role::kNone);
}

TEST(RoleGroups, RootAndTheDaemonsUserMayDoEverything) {
  const auto groups = RoleGroups::Find({.viewers = {"2001"}}, kDaemon);
  ASSERT_TRUE(groups);
  EXPECT_EQ(groups->RoleOf(Peer{.pid = 1, .uid = 0, .gid = 0}), Role::kEngineer);
  EXPECT_EQ(groups->RoleOf(Peer{.pid = 1, .uid = kDaemon, .gid = 9}), Role::kEngineer);
}

TEST(RoleGroups, FindGroupsByName) {
  const auto groups = RoleGroups::Find({.operators = {"root"}}, kDaemon);
  ASSERT_TRUE(groups);
  EXPECT_EQ(groups->RoleOf(Member(7, {0})), Role::kOperator);
}

TEST(RoleGroups, AGroupThatIsNotThereIsNamed) {
  for (const char* name : {"no-such-group", "", "-1", "2001x"}) {
    const auto groups = RoleGroups::Find({.operators = {name}}, kDaemon);
    ASSERT_FALSE(groups) << name;
    EXPECT_THAT(groups.error().text, HasSubstr("control.operators"));
    EXPECT_THAT(groups.error().text, HasSubstr(std::string("'") + name + "'"));
  }
}

}  // namespace
}  // namespace focalfleet
