#include "daemon/store/schema.h"

#include <gmock/gmock.h>

#include "tests/daemon/store/faulty_disk.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet::store_internal {
namespace {

using focalfleet::testing::StoreTest;

std::unique_ptr<Connection> Open(const std::string& path, const char* vfs = nullptr) {
  auto connection = Connection::Open(path, Connection::Mode::kWrite, vfs, 0);
  EXPECT_TRUE(connection);
  return std::move(*connection);
}

TEST_F(StoreTest, MigrationsCarryAStoreOverStepByStep) {
  const char* const steps[] = {
      "CREATE TABLE place(id INTEGER PRIMARY KEY, deg REAL) STRICT; INSERT INTO place VALUES(1, 2)",
      "ALTER TABLE place ADD COLUMN turns INTEGER NOT NULL DEFAULT 7",
      "UPDATE place SET turns = turns + 1"};
  auto connection = Open(Path());
  for (std::size_t known = 1; known <= 3; ++known) {  // three releases, one after the other
    const auto version = static_cast<std::int32_t>(known) - 1;
    ASSERT_EQ(connection->Integer("PRAGMA user_version"), version);
    ASSERT_TRUE(Migrate(*connection, version, std::span(steps).first(known)));
  }
  EXPECT_EQ(connection->Integer("PRAGMA user_version"), 3);
  EXPECT_EQ(connection->Integer("SELECT turns FROM place"), 8);
  auto all_at_once = Open(folder_.File("second.db"));
  ASSERT_TRUE(Migrate(*all_at_once, 0, steps));
  EXPECT_EQ(all_at_once->Integer("SELECT turns FROM place"), 8);
}

TEST_F(StoreTest, AFailedStepLeavesTheVersionBeforeIt) {
  const char* const steps[] = {"CREATE TABLE a(x)", "CREATE TABLE b(x); CREATE TABLE a(x)"};
  auto connection = Open(Path());
  const Status done = Migrate(*connection, 0, steps);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().text, ::testing::HasSubstr("version 2"));
  EXPECT_EQ(connection->Integer("PRAGMA user_version"), 1);
  EXPECT_EQ(connection->Integer("SELECT count(*) FROM sqlite_schema"), 1);
}

TEST_F(StoreTest, OpeningANewStoreSurvivesEveryFailingWrite) {
  focalfleet::testing::FaultyDisk disk;
  std::uint64_t n = 1;
  for (;; ++n) {
    ASSERT_LT(n, 1000u);
    const std::string path = folder_.File("n" + std::to_string(n) + ".db");
    disk.FailAt(n, SQLITE_IOERR_WRITE, false);
    const auto store = Store::Open(path, {.vfs = disk.kVfsName});
    const bool failed = disk.has_failed();
    disk.Heal();
    if (!failed) break;
    if (!store) {
      EXPECT_EQ(store.error().code, ErrorCode::kUnavailable) << store.error().text;
      const auto again = Store::Open(path);
      ASSERT_TRUE(again) << again.error().text;
      EXPECT_TRUE((*again)->Load());
    }
  }
  EXPECT_GT(n, 10u);  // or nothing was tried
}

}  // namespace
}  // namespace focalfleet::store_internal
