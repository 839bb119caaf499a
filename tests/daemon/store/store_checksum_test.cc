// A wrong bit in the store's file is noticed: a disk may return another bit than was written.
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <set>

#include "daemon/store/schema.h"
#include "daemon/store/store.h"
#include "protocol/base/rng.h"
#include "tests/daemon/store/store_fixture.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::Intent;
using test::StoreTest;
using test::Vector;

std::string Bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Expects the same facts of where units stand, whether they move and how.
void ExpectSame(const StoredFleet& read, const StoredFleet& written, const std::string& what) {
  EXPECT_EQ(read.units, written.units) << what;
  EXPECT_EQ(read.vectors, written.vectors) << what;
  EXPECT_EQ(read.open_intents, written.open_intents) << what;
  EXPECT_EQ(read.parameters, written.parameters) << what;
  EXPECT_EQ(read.tunings, written.tunings) << what;
  EXPECT_EQ(read.next_move, written.next_move) << what;
  EXPECT_EQ(read.next_configuration, written.next_configuration) << what;
}

/// A store that has rows in every table that decides where units stand.
class WrongBits : public StoreTest {
 protected:
  void SetUp() override {
    constexpr std::uint32_t kSerials = 40;
    std::vector<Row> rows = test::Batch(9, kSerials);
    for (std::uint32_t unit = 1; unit <= kSerials; ++unit) {
      rows.emplace_back(BindingRow{{unit}, {unit}});
      if (unit % 3 == 0) rows.emplace_back(EnableRow{{unit}, false, "arm bent"});
      if (unit % 2 == 0) rows.emplace_back(Intent(unit, unit, 10, {9, -9}, {70, 80}));
      // An interval repeats nothing by which a wrong bit shows.
      VectorRow interval = Vector(unit, Witness::kInterval, 300, 400);
      for (AxisKnowledge& axis : interval.knowledge) axis.high += 70'000;
      rows.emplace_back(interval);
    }
    rows.emplace_back(ConfigurationRow{.id = 3, .source = "night.csv"});
    test::ExpectDone(OpenStore()->Commit(rows, test::kEight));
    good_ = Bytes(Path());
    ASSERT_FALSE(std::filesystem::exists(Path() + "-wal"));
    written_ = *OpenStore()->Load();
    ASSERT_EQ(written_.open_intents.size(), kSerials / 2);
  }

  /// Expects that a file with that one bit wrong is refused, or read as it was written. The result
  /// is whether it is refused.
  bool Refused(std::uint64_t bit) {
    std::string wrong = good_;
    wrong[bit / 8] = static_cast<char>(wrong[bit / 8] ^ static_cast<char>(1 << bit % 8));
    const std::string copy = folder_ / "copy.db";
    for (const char* suffix : {"-wal", "-shm"}) std::filesystem::remove(copy + suffix);
    std::ofstream(copy, std::ios::binary) << wrong;
    auto store = Store::Open(copy);
    const auto read = store ? (*store)->Load() : tl::unexpected<Error>(store.error());
    if (read) ExpectSame(*read, written_, "bit " + std::to_string(bit));
    return !read;
  }

  /// Numbers of the pages, from 1, that are no root of a table which decides nothing.
  [[nodiscard]] std::set<std::uint64_t> DecidingPages() {
    std::set<std::uint64_t> pages;
    for (std::uint64_t page = 1; page <= good_.size() / kPageBytes; ++page) pages.insert(page);
    auto connection = store_internal::Connection::Open(
        Path(), store_internal::Connection::Mode::kRead, nullptr, 0);
    auto roots = (*connection)
                     ->Prepare(
                         "SELECT rootpage FROM sqlite_schema WHERE tbl_name NOT IN "
                         "('unit', 'axis_state', 'intent', 'parameter', 'tuning', 'meta')");
    while (*roots->Next())
      pages.erase(static_cast<std::uint64_t>(sqlite3_column_int64(roots->get(), 0)));
    return pages;
  }

  static constexpr std::uint64_t kPageBytes = 4096;
  std::string good_;
  StoredFleet written_;
};

TEST_F(WrongBits, ChangeNothingThatIsLoaded) {
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int refused = 0;
  for (int round = 0; round < 500; ++round) {
    std::uint64_t bit = rng.Below(8 * good_.size());
    while (good_[bit / 8] == 0) bit = rng.Below(8 * good_.size());  // free space for the most part
    if (Refused(bit)) ++refused;
    if (HasFailure()) return;
  }
  // Much of a file is free space. Without checksums a sixth of the bits is noticed.
  EXPECT_GT(refused, 30);
}

// Rows are lost where a page's header counts fewer than it has.
TEST_F(WrongBits, InHeadersOfPagesLoseNoRow) {
  constexpr std::uint64_t kHeaderBytes = 12;       // of an inner page; a leaf has 8
  constexpr std::uint64_t kFileHeaderBytes = 100;  // before the header of the first page
  int refused = 0;
  const std::set<std::uint64_t> pages = DecidingPages();
  EXPECT_GE(pages.size(), 10u);
  for (const std::uint64_t page : pages) {
    const std::uint64_t header = page == 1 ? kFileHeaderBytes : (page - 1) * kPageBytes;
    for (std::uint64_t bit = 8 * header; bit < 8 * (header + kHeaderBytes); ++bit) {
      if (Refused(bit)) ++refused;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(refused, 500);
}

TEST_F(StoreTest, ALostRowOfTheCountOfOpenMovesIsMissed) {
  OpenStore();
  Sql("DELETE FROM meta WHERE key = 'open_intents'");
  EXPECT_THAT(test::ErrorOf(OpenStore()->Load()).text, ::testing::HasSubstr("open_intents"));
}

TEST_F(StoreTest, AZeroWithASignIsStoredLikeAnyNumber) {
  auto store = OpenStore();
  test::ExpectDone(
      store->Commit(std::vector<Row>{test::Tuned(37, -0.0), test::Tuned(38, -0.0)}, test::kEight));
  const auto fleet = store->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->tunings.at(0).margin, 0);
}

TEST_F(StoreTest, AStoreOfVersionNineGetsChecksumsOfItsRows) {
  using store_internal::Connection;
  using store_internal::Migrations;
  {
    auto connection = Connection::Open(Path(), Connection::Mode::kWrite, nullptr, 0);
    ASSERT_TRUE(connection);
    test::ExpectDone(store_internal::Migrate(**connection, 0, Migrations().first(9)));
    test::ExpectDone(
        (*connection)
            ->Execute("INSERT INTO unit VALUES(12, 7, 0, 'arm bent', 5); INSERT INTO meta "
                      "VALUES('next_move', 4);"
                      "INSERT INTO axis_state VALUES(7, 0, 3, 5, 5, 5, 0, 96, 3, 4, 5, 0);"
                      "INSERT INTO axis_state VALUES(7, 1, 1, 5, 6, NULL, NULL, 96, 3, 4, 5, 0);"
                      "INSERT INTO parameter VALUES(7, 1, 1, 37, 1, 5);"
                      "INSERT INTO intent VALUES(1, 1, 12, 7, 3, 0, 0, 1, 1, 0, 1, 0, 1, 5, NULL, "
                      "NULL, NULL, "
                      "NULL, NULL, NULL, NULL, NULL)"));
  }
  const auto fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->units.size(), 1u);
  EXPECT_EQ(fleet->vectors.size(), 1u);
  EXPECT_EQ(fleet->parameters.size(), 1u);
  EXPECT_EQ(fleet->open_intents.size(), 1u);
  EXPECT_EQ(fleet->next_move.value, 4u);
  Sql("UPDATE unit SET enabled = 1");
  EXPECT_EQ(test::ErrorOf(OpenStore()->Load()).code, ErrorCode::kInvalid);
}

TEST_F(StoreTest, RowsThatChangeInPartKeepTheirChecksums) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(
      std::vector<Row>{BindingRow{{1}, {11}}, EnableRow{{1}, false, "arm bent"},
                       BindingRow{{2}, {11}}, BindingRow{{1}, {12}}, EnableRow{{1}, true, ""},
                       Intent(1, 12, 3, {0, 0}, {1, 1}), Intent(1, 12, 3, {0, 0}, {2, 2}),
                       ParameterRow{{12}, Axis::kPhi, Parameter::kRepeat, 37, Origin::kTuning},
                       ParameterRow{{12}, Axis::kPhi, Parameter::kRepeat, 38, Origin::kOperator}},
      test::kEight));
  const auto fleet = store->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->open_intents.size(), 1u);
  EXPECT_EQ(fleet->open_intents[0].to, (Pose{2, 2}));
}

}  // namespace
}  // namespace focalfleet
