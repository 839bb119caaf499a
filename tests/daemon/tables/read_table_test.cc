#include "daemon/tables/read_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "daemon/files/fits_table.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

class ReadTableTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string TextOfFile(const std::string& name, const std::string& text) const {
    const auto table = ReadTableText(scratch_.Put(name, text), "unit_id");
    return table ? table->text : "error: " + table.error().text;
  }
  const test::ScratchFolder scratch_;
};

TEST_F(ReadTableTest, TextInLinesStaysAsItIs) {
  const std::string csv = "# a\r\nunit_id,x_mm\r\n1,2\r\n";
  EXPECT_EQ(TextOfFile("a.fits", csv), csv) << "the name does not count";
  const auto table = ReadTableText(scratch_ / "a.fits", "unit_id");
  EXPECT_EQ(table->note, "");
}

TEST_F(ReadTableTest, AFitsTableHasRowsUnitsVectorsAndMissingValues) {
  const std::string path = scratch_ / "t.fits";
  ASSERT_TRUE(
      WriteFitsTable(path, {.name = "T",
                            .keys = {{"EXPID", std::int64_t{7}, ""}},
                            .columns = {{"UNIT_ID", "", std::vector<std::int64_t>{1, 2}},
                                        {"X_MM", "m", std::vector<double>{0.5, std::nan("")}},
                                        {"pair", "", std::vector<double>{1, 2, 3, 4}, 2},
                                        {"NAME", "", std::vector<std::string>{"a, \"b\"", ""}}}}));
  const auto tables = ReadTables(path);
  ASSERT_TRUE(tables) << tables.error().text;
  const NamedTable& table = tables->front();
  EXPECT_EQ(table.name, "T");
  EXPECT_EQ(table.Key("expid"), "7");
  CsvRow first(table.table, 0);
  EXPECT_EQ(first.Number("x_mm"), 500);
  EXPECT_EQ(first.Number("pair_1"), 2);
  EXPECT_EQ(first.Text("name"), "a, \"b\"");
  CsvRow second(table.table, 1);
  second.Number("x_mm");
  ASSERT_TRUE(second.error());
  EXPECT_EQ(second.error()->text,
            path + ": row 2: column x_mm: the value is missing (empty or nan)");
  const auto text = ReadTableText(path, "unit_id");
  EXPECT_EQ(text->note, path + ": a FITS file, 2 rows");
}

TEST_F(ReadTableTest, DamagedFilesAreRefusedByName) {
  EXPECT_THAT(TextOfFile("a", "SIMPLE  =                    T"), HasSubstr("a: unit 0: "));
  EXPECT_THAT(TextOfFile("b", "{\"unit_id\": [1"), HasSubstr("b: not JSON"));
  EXPECT_THAT(TextOfFile("c", "<a>"), HasSubstr("c:1: "));
  EXPECT_THAT(TextOfFile("d", "\x1f\x8b\x08"), HasSubstr("d: its gzip stream is cut short"));
  EXPECT_THAT(TextOfFile("e", "BZh91AY&SY\x01\x02"), HasSubstr("bunzip2"));
  EXPECT_THAT(TextOfFile("f", "unit_id\n\xff\n"), HasSubstr("f:2: not a text file"));
}

TEST_F(ReadTableTest, AFolderMayHaveItsTablesInAnyFormat) {
  EXPECT_EQ(FindTable(scratch_.path(), "moves"), scratch_ / "moves.csv");
  scratch_.Put("moves.fits", "");
  EXPECT_EQ(FindTable(scratch_.path(), "moves"), scratch_ / "moves.fits");
  scratch_.Put("moves.csv", "");
  EXPECT_EQ(FindTable(scratch_.path(), "moves"), scratch_ / "moves.csv");
}

}  // namespace
}  // namespace focalfleet
