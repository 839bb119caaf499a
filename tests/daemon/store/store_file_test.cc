// The store's file: a second writer, a later version, something else, damage.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <fstream>
#include <iterator>

#include "daemon/store/store.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::ErrorOf;
using test::kEight;
using test::StoreTest;
using test::Vector;
using ::testing::HasSubstr;

std::string Bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST_F(StoreTest, ASecondWriterIsRefusedAndTheFirstNamed) {
  auto store = OpenStore();
  const auto second = Store::Open(Path());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("process " + std::to_string(getpid())));
  // The same holds by another name of the file.
  std::filesystem::create_symlink(Path(), folder_ / "link.db");
  EXPECT_EQ(ErrorOf(Store::Open(folder_ / "link.db")).code, ErrorCode::kRefused);
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(1, Witness::kReported, 1, 1)}, kEight));
  store.reset();
  EXPECT_EQ(OpenStore()->Load()->vectors.size(), 1u);
}

TEST_F(StoreTest, TheLockEndsWithItsProcess) {
  int ready[2];
  int hold[2];
  char end = 0;
  ASSERT_EQ(pipe(ready), 0);
  ASSERT_EQ(pipe(hold), 0);
  const pid_t child = fork();
  if (child == 0) {
    auto store = Store::Open(Path());
    const char word = store ? 'y' : 'n';
    close(hold[1]);
    // The child ends with its parent at the latest.
    _exit(write(ready[1], &word, 1) == 1 && read(hold[0], &end, 1) == 0 ? 0 : 1);
  }
  char word = 0;
  ASSERT_EQ(read(ready[0], &word, 1), 1);
  EXPECT_EQ(word, 'y');
  EXPECT_THAT(ErrorOf(Store::Open(Path())).text, HasSubstr("process " + std::to_string(child)));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(Store::Open(Path()));
  for (const int descriptor : {ready[0], ready[1], hold[0], hold[1]}) close(descriptor);
}

TEST_F(StoreTest, ANewerStoreIsLeftAsItIs) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 3), kEight));
  Sql("PRAGMA user_version = 99");
  const std::string before = Bytes(Path());
  const auto store = Store::Open(Path());
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kNewer);
  EXPECT_THAT(store.error().text, HasSubstr("version 99"));
  EXPECT_EQ(Bytes(Path()), before);
  EXPECT_FALSE(std::filesystem::exists(Path() + "-wal"));
  EXPECT_EQ(ErrorOf(StoreReader::Open(Path())).code, ErrorCode::kNewer);
  EXPECT_EQ(Bytes(Path()), before);
}

TEST_F(StoreTest, ANewerStoreIsSeenInItsWalToo) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 3), kEight));
  // A later version that was killed before its WAL reached the file.
  const pid_t child = fork();
  if (child == 0) {
    sqlite3* db = nullptr;
    sqlite3_open(Path().c_str(), &db);
    sqlite3_exec(db, "PRAGMA user_version = 99", nullptr, nullptr, nullptr);
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  const std::string before = Bytes(Path());
  const std::string wal = Bytes(Path() + "-wal");
  ASSERT_FALSE(wal.empty());
  EXPECT_EQ(ErrorOf(Store::Open(Path())).code, ErrorCode::kNewer);
  EXPECT_EQ(Bytes(Path()), before);
  EXPECT_EQ(Bytes(Path() + "-wal"), wal);
}

TEST_F(StoreTest, AFileThatIsNoStoreIsRefusedAndLeftAlone) {
  for (const std::string& content : {std::string("unit_id,x_mm\n1,2\n"),
                                     std::string("SQLite format 3"), std::string(5000, '\xff')}) {
    std::ofstream(Path(), std::ios::binary) << content;
    const auto store = Store::Open(Path());
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::kInvalid);
    EXPECT_THAT(store.error().text, HasSubstr("not a store"));
    EXPECT_EQ(Bytes(Path()), content);
  }
  std::filesystem::remove(Path());
  Sql("CREATE TABLE foreign_table(x)");
  const std::string before = Bytes(Path());
  EXPECT_THAT(ErrorOf(Store::Open(Path())).text, HasSubstr("not a store"));
  EXPECT_EQ(Bytes(Path()), before);
}

TEST_F(StoreTest, AnEmptyFileBecomesAStore) {
  std::ofstream(Path()).close();
  EXPECT_TRUE(OpenStore()->Load());
}

TEST_F(StoreTest, DamagedPagesAreAnError) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 200), kEight));
  std::string content = Bytes(Path());
  for (std::size_t i = 4096; i < content.size(); ++i) content[i] = static_cast<char>(i * 37);
  std::ofstream(Path(), std::ios::binary) << content;
  const auto store = Store::Open(Path());
  if (store) {
    EXPECT_FALSE((*store)->Load());
  } else {
    EXPECT_EQ(store.error().code, ErrorCode::kInvalid);
  }
}

TEST_F(StoreTest, ADamagedTableIsNoFaultOfTheRow) {
  const std::vector<Row> rows = {AlarmRow{.id = 1, .text = "the first"}};
  test::ExpectDone(OpenStore()->Commit(rows, kEight));
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(Path().c_str(), &db), SQLITE_OK);
  const auto number = [&](const char* sql) {
    sqlite3_stmt* statement = nullptr;
    EXPECT_EQ(sqlite3_prepare_v2(db, sql, -1, &statement, nullptr), SQLITE_OK);
    EXPECT_EQ(sqlite3_step(statement), SQLITE_ROW);
    const std::int64_t value = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return value;
  };
  const std::int64_t page = number("SELECT rootpage FROM sqlite_master WHERE name = 'alarm'");
  const std::int64_t page_bytes = number("PRAGMA page_size");
  sqlite3_close(db);
  std::fstream file(Path(), std::ios::binary | std::ios::in | std::ios::out);
  file.seekp((page - 1) * page_bytes);
  file << std::string(static_cast<std::size_t>(page_bytes), '\xa5');
  file.close();
  const auto store = OpenStore();
  ASSERT_TRUE(store);
  const std::vector<Row> next = {AlarmRow{.id = 2, .text = "the second"}};
  EXPECT_EQ(ErrorOf(store->Commit(next, kEight)).code, ErrorCode::kUnavailable);
}

TEST_F(StoreTest, AMissingFolderIsUnavailable) {
  EXPECT_EQ(ErrorOf(Store::Open(folder_ / "none/fleet.db")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(ErrorOf(StoreReader::Open(folder_ / "none.db")).code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace focalfleet
