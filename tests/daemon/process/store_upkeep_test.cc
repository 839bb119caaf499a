// The upkeep of the store: the head of the audit leaves the store, and none is lost on the way.
#include "daemon/process/store_upkeep.h"

#include <gmock/gmock.h>

#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using StoreUpkeepTest = test::StoreTest;

std::vector<Row> Command(const std::string& verb) {
  return {AuditRow{
      .door = "http", .name = "token dome", .role = "operator", .verb = verb, .taken = true}};
}

TEST_F(StoreUpkeepTest, EachHeadIsReportedOnceAndARefusedOneAgain) {
  auto store = OpenStore();
  std::vector<AuditHead> reported;
  bool takes = false;
  const auto upkeep = UpkeepOf(store.get(), 0, [&](const AuditHead& head) {
    if (takes) reported.push_back(head);
    return takes;
  });
  ASSERT_TRUE(upkeep);
  test::ExpectDone(store->Commit(Command("enable"), test::kEight));
  (*upkeep)();
  EXPECT_THAT(reported, IsEmpty());
  takes = true;
  (*upkeep)();
  (*upkeep)();
  const AuditHead first = *store->LastAudit();
  EXPECT_EQ(first.entry, 1u);
  EXPECT_THAT(reported, ElementsAre(first));
  test::ExpectDone(store->Commit(Command("home"), test::kNine));
  (*upkeep)();
  EXPECT_THAT(reported, ElementsAre(first, *store->LastAudit()));
  EXPECT_TRUE(OpenReader()->CheckAudit(reported)) << "the store takes them as its own";
}

}  // namespace
}  // namespace focalfleet
