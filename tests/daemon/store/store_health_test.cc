#include "daemon/store/store_health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::ErrorOf;
using test::kEight;
using ::testing::HasSubstr;

class StoreHealthTest : public test::StoreTest {};

TEST_F(StoreHealthTest, ASoundStoreIsCountedWhileItsWriterHasIt) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Commit(std::vector<Row>{ConfigurationRow{.id = 3}}, kEight));
  const auto health = InspectHealth(Path());
  ASSERT_TRUE(health) << health.error().text;
  EXPECT_EQ(health->flaw, "");
  EXPECT_EQ(health->version, health->version_expected);
  EXPECT_EQ(health->configurations, 1u);
  EXPECT_EQ(health->since, kEight);
  EXPECT_GT(health->bytes, 4096u);
}

TEST_F(StoreHealthTest, AnEmptyStoreHasNoBeginning) {
  OpenStore();
  const auto health = InspectHealth(Path());
  ASSERT_TRUE(health) << health.error().text;
  EXPECT_EQ(health->configurations, 0u);
  EXPECT_FALSE(health->since);
}

TEST_F(StoreHealthTest, ADamagedPageIsAFlaw) {
  OpenStore();
  const auto size = std::filesystem::file_size(Path());
  ASSERT_GE(size, 4u * 4096);
  {
    std::fstream file(Path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(3 * 4096);  // the first page stays, so that it is found to be a store
    file << std::string(static_cast<std::size_t>(size) - 3 * 4096, '\x5a');
  }
  const auto health = InspectHealth(Path());
  ASSERT_TRUE(health) << health.error().text;
  EXPECT_NE(health->flaw, "");
}

TEST_F(StoreHealthTest, SaysWhyThereIsNothingToInspect) {
  EXPECT_EQ(ErrorOf(InspectHealth(Path())).code, ErrorCode::kUnavailable);
  std::ofstream(Path()) << "a text that is no store, and longer than the header of one: "
                        << std::string(200, 'x');
  EXPECT_EQ(ErrorOf(InspectHealth(Path())).code, ErrorCode::kInvalid);
  std::filesystem::remove(Path());
  OpenStore();
  Sql("PRAGMA user_version = 1000");
  EXPECT_EQ(ErrorOf(InspectHealth(Path())).code, ErrorCode::kNewer);
}

}  // namespace
}  // namespace focalfleet
