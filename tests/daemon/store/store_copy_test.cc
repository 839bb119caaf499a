// Backup, check and restore of a store.
#include "daemon/store/store_copy.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::Batch;
using test::BatchIn;
using test::ErrorOf;
using test::kEight;
using test::StoreTest;
using test::Vector;
using ::testing::HasSubstr;

constexpr std::uint32_t kSerials = 50;

Error ErrorOf(const Status& status) {
  return status ? Error{static_cast<ErrorCode>(99), "success"} : status.error();
}

Status Sound(const std::string& path) {
  const auto health = CheckStore(path);
  return health ? Status() : tl::unexpected<Error>(health.error());
}

std::size_t FilesIn(const std::filesystem::path& folder) {
  const std::filesystem::directory_iterator files(folder);
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

TEST_F(StoreTest, ABackupBesideTheWriterHoldsAWholeBatch) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(Batch(1, kSerials), kEight));
  std::atomic<std::uint32_t> committed{1};
  std::atomic<bool> ending{false};
  std::thread writer([&] {
    while (!ending) {
      test::ExpectDone(store->Commit(Batch(committed + 1, kSerials), kEight));
      ++committed;
    }
  });
  for (int round = 0; round < 10; ++round) {
    const std::string copy = folder_ / ("backup" + std::to_string(round) + ".db");
    const std::uint32_t before = committed;
    test::ExpectDone(BackUpStore(Path(), copy));
    test::ExpectDone(Sound(copy));
    EXPECT_FALSE(std::filesystem::exists(copy + "-wal")) << "a backup is one file";
    const auto fleet = (*Store::Open(copy))->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    const std::uint32_t held = BatchIn(*fleet, kSerials);
    EXPECT_GE(held, before);
    EXPECT_LE(held, committed + 1);
  }
  ending = true;
  writer.join();
}

TEST_F(StoreTest, ABackupReplacesNothing) {
  test::ExpectDone(OpenStore()->Commit(Batch(1, kSerials), kEight));
  const std::string copy = folder_ / "backup.db";
  std::ofstream(copy) << "mine";
  const Error error = ErrorOf(BackUpStore(Path(), copy));
  EXPECT_EQ(error.code, ErrorCode::kRefused);
  EXPECT_THAT(error.text, HasSubstr("backup.db is there already"));
  std::string text;
  std::ifstream(copy) >> text;
  EXPECT_EQ(text, "mine");
}

TEST_F(StoreTest, ADamagedStoreIsNoBackup) {
  test::ExpectDone(OpenStore()->Commit(Batch(1, kSerials), kEight));
  Sql("UPDATE axis_state SET at_ns = 7 WHERE serial = 3");
  EXPECT_THAT(ErrorOf(CheckStore(Path())).text, HasSubstr("row serial 3"));
  const std::size_t files = FilesIn(folder_ / ".");
  EXPECT_EQ(ErrorOf(BackUpStore(Path(), folder_ / "backup.db")).code, ErrorCode::kInvalid);
  EXPECT_EQ(FilesIn(folder_ / "."), files);
  std::ofstream(Path()) << "no store";
  EXPECT_EQ(ErrorOf(CheckStore(Path())).code, ErrorCode::kInvalid);
}

TEST_F(StoreTest, AnEmptyFileIsNoStore) {
  std::ofstream(Path()).flush();
  const Error error = ErrorOf(CheckStore(Path()));
  EXPECT_EQ(error.code, ErrorCode::kInvalid);
  EXPECT_THAT(error.text, HasSubstr("nothing is in it"));
  EXPECT_EQ(ErrorOf(BackUpStore(Path(), folder_ / "backup.db")).code, ErrorCode::kInvalid);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "backup.db"));
}

TEST_F(StoreTest, ADamagedBackupIsNotRestoredAsASoundStore) {
  test::ExpectDone(OpenStore()->Commit(std::vector<Row>{NextMoveRow{{1000}}}, kEight));
  Sql("UPDATE meta SET value = 1001 WHERE key = 'next_move'");
  std::filesystem::rename(Path(), folder_ / "backup.db");
  EXPECT_THAT(ErrorOf(RestoreStore(folder_ / "backup.db", Path())).text, HasSubstr("next_move"));
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

TEST_F(StoreTest, NothingIsRestoredBesideALogOfAnotherStore) {
  test::ExpectDone(OpenStore()->Commit(Batch(1, kSerials), kEight));
  std::filesystem::rename(Path(), folder_ / "backup.db");
  for (const std::string suffix : {"-wal", "-journal"}) {
    std::ofstream(Path() + suffix) << "of another store";
    const Error error = ErrorOf(RestoreStore(folder_ / "backup.db", Path()));
    EXPECT_EQ(error.code, ErrorCode::kRefused);
    EXPECT_THAT(error.text, HasSubstr("fleet.db" + suffix + " is there already"));
    std::filesystem::remove(Path() + suffix);
  }
}

TEST_F(StoreTest, ARestoredStoreBelongsToTheOwnerOfItsFolder) {
  test::ExpectDone(OpenStore()->Commit(Batch(1, kSerials), kEight));
  const std::string folder = folder_ / "daemon";
  ASSERT_TRUE(std::filesystem::create_directory(folder));
  // Only root can give a file away; for all others the owner stays.
  const bool root = ::geteuid() == 0;
  const uid_t user = root ? 12345 : ::geteuid();
  const gid_t group = root ? 12346 : ::getegid();
  ASSERT_EQ(::chown(folder.c_str(), user, group), 0);
  ASSERT_EQ(::chmod(folder.c_str(), 0770), 0);
  const std::string store = folder + "/fleet.db";
  test::ExpectDone(RestoreStore(Path(), store));
  for (const std::string& path : {store, store + ".lock"}) {
    struct stat file {};
    ASSERT_EQ(::stat(path.c_str(), &file), 0);
    EXPECT_EQ(file.st_uid, user) << path;
    EXPECT_EQ(file.st_gid, group) << path;
    EXPECT_EQ(file.st_mode & 0777u, 0660u) << path;
  }
}

TEST_F(StoreTest, ARestoredStoreGoesOnWithOtherNumbersOfMoves) {
  const std::string backup = folder_ / "backup.db";
  {
    auto store = OpenStore();
    test::ExpectDone(store->Commit(
        std::vector<Row>{Vector(7, Witness::kReported, 10, 20), NextMoveRow{{1000}}}, kEight));
    test::ExpectDone(BackUpStore(Path(), backup));
    test::ExpectDone(store->Commit(
        std::vector<Row>{Vector(7, Witness::kReported, 11, 21), NextMoveRow{{3000}}}, kEight));
    EXPECT_EQ(ErrorOf(RestoreStore(backup, Path())).code, ErrorCode::kRefused) << "in use";
  }
  EXPECT_THAT(ErrorOf(RestoreStore(backup, Path())).text, HasSubstr("fleet.db is there already"));
  std::filesystem::rename(Path(), folder_ / "damaged.db");
  test::ExpectDone(RestoreStore(backup, Path()));
  const auto fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  ASSERT_EQ(fleet->vectors.size(), 1u);
  EXPECT_EQ(PlaceOf(fleet->vectors[0].knowledge), (Pose{10, 20}));
  // The next number is further from both 1000 and 3000 than a night has moves.
  EXPECT_GT(fleet->next_move.value, 30'000);
  EXPECT_LT(fleet->next_move.value, 36'000);
}

}  // namespace
}  // namespace focalfleet
