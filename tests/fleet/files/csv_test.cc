#include "fleet/files/csv.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

std::string ErrorOf(std::string_view text) {
  const auto table = CsvTable::Parse(text, "a.csv");
  return table ? "" : table.error().text;
}

CsvTable Parsed(std::string_view text) {
  auto table = CsvTable::Parse(text, "a.csv");
  EXPECT_TRUE(table) << table.error().text;
  return table ? std::move(*table) : CsvTable();
}

TEST(Csv, ReadsHeaderCommentsBlankLinesAndCrlf) {
  const CsvTable table =
      Parsed("\xEF\xBB\xBF# made by hand\r\n\r\nunit_id , x_mm\r\n1, 2.5\r\n\r\n# end\r\n7,\r\n");
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table.columns(), (std::vector<std::string>{"unit_id", "x_mm"}));
  EXPECT_EQ(table.line(0), 4);
  EXPECT_EQ(table.line(1), 7);
  CsvRow first(table, 0);
  EXPECT_EQ(first.Integer("unit_id", {0, 9}), 1);
  EXPECT_EQ(first.Number("x_mm"), 2.5);
  EXPECT_FALSE(first.error());
  EXPECT_FALSE(CsvRow(table, 1).Has("x_mm"));
}

TEST(Csv, QuotedCellsHoldCommasQuotesAndNewlines) {
  const CsvTable table = Parsed("id,name\n1,\"a, \"\"b\"\"\nc\" \n2,plain # text\n");
  EXPECT_EQ(CsvRow(table, 0).Text("name"), "a, \"b\"\nc");
  EXPECT_EQ(CsvRow(table, 1).Text("name"), "plain # text");
  EXPECT_EQ(table.line(1), 4) << "counted as lines of the file";
}

TEST(Csv, EcsvOfAstropyReadsWithBlanksAndWithCommas) {
  const std::string head =
      "# %ECSV 1.0\n# ---\n# datatype:\n# - {name: unit_id, datatype: int64}\n";
  const CsvTable blanks = Parsed(head + "unit_id x_mm target_id\n1 2.5 \"NGC 1\"\n2 nan \"\"\n");
  ASSERT_EQ(blanks.size(), 2u);
  EXPECT_EQ(CsvRow(blanks, 0).Text("target_id"), "NGC 1");
  EXPECT_EQ(CsvRow(blanks, 0).NumberIfAny("x_mm"), 2.5);
  EXPECT_EQ(CsvRow(blanks, 1).NumberIfAny("x_mm"), std::nullopt);
  EXPECT_EQ(Parsed(head + "# delimiter: ','\nunit_id,x_mm\n1,2\n").columns().size(), 2u);
}

TEST(Csv, EmptyAndNanAreMissing) {
  const CsvTable table = Parsed("a,b,c,d,e\n,nan,NaN,\"\", \n");
  CsvRow row(table, 0);
  for (const char* column : {"a", "b", "c", "d", "e", "no such"}) {
    EXPECT_FALSE(row.Has(column));
    EXPECT_EQ(row.NumberIfAny(column), std::nullopt);
    EXPECT_EQ(row.IntegerIfAny(column, {0, 1}), std::nullopt);
  }
  EXPECT_FALSE(row.error());
}

TEST(Csv, RefusesFilesNamingLineAndReason) {
  EXPECT_EQ(ErrorOf(""), "a.csv: empty, a header line is expected");
  EXPECT_EQ(ErrorOf("# only\n\n"), "a.csv: empty, a header line is expected");
  EXPECT_EQ(ErrorOf("a,b\n1,2\n3\n"), "a.csv:3: 1 cells, but the header has 2 columns: cut short?");
  EXPECT_EQ(ErrorOf("a,b\n1,2,3\n"), "a.csv:2: 3 cells, but the header has 2 columns");
  EXPECT_EQ(
      ErrorOf("a,b\n1,2\n3,4"),
      "a.csv:3: the last line does not end: the file is cut short (or end it with a newline)");
  EXPECT_EQ(ErrorOf("a,b\n1,\"2\n3,4\n"),
            "a.csv:2: a quote is not closed: the file is cut short or wrong");
  EXPECT_EQ(ErrorOf("a,b\n1,\"2\"3\n"), "a.csv:2: text after a closing quote");
  EXPECT_EQ(ErrorOf("a,a\n"), "a.csv:1: column 'a' is there twice");
  EXPECT_EQ(ErrorOf("a,,b\n"), "a.csv:1: a column of the header has no name");
  EXPECT_EQ(ErrorOf(std::string_view("a\n1\n\0\n", 6)), "a.csv:3: not a text file (byte 0x00)");
  EXPECT_EQ(ErrorOf("\x1f\x8b\x08 gzip"), "a.csv:1: not a text file (byte 0x1f)");
  EXPECT_EQ(ErrorOf("SIMPLE  =                    T"),
            "a.csv:1: this is a FITS file, a CSV table is expected");
}

TEST(Csv, NamesTheColumnThatIsMissingAndThoseThatAreThere) {
  const CsvTable table = Parsed("# x\nunit_id,x,y\n");
  const Status status = table.Require({"unit_id", "x_mm", "y_mm"});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().text, "a.csv:2: column x_mm, y_mm is missing; there are: unit_id, x, y");
  EXPECT_TRUE(table.Require({"x", "y"}));
  EXPECT_EQ(table.Others({"unit_id", "y"}), std::vector<std::string>{"x"});
}

TEST(CsvRow, RefusesCellsNamingLineColumnAndReason) {
  const auto error_of = [](const std::string& cell, auto read) {
    const CsvTable table = Parsed("a,b\n0,0\n1," + cell + "\n");
    CsvRow row(table, 1);
    read(row);
    return row.error() ? row.error()->text : "";
  };
  const auto number = [](CsvRow& row) { row.Number("b"); };
  const auto integer = [](CsvRow& row) { row.Integer("b", {1, 9}); };
  EXPECT_EQ(error_of("", number), "a.csv:3: column b: the value is missing (empty or nan)");
  EXPECT_EQ(error_of("nan", number), "a.csv:3: column b: the value is missing (empty or nan)");
  EXPECT_EQ(error_of("2.5x", number), "a.csv:3: column b: '2.5x' is not a number");
  EXPECT_EQ(error_of("1e999", number), "a.csv:3: column b: '1e999' is not a number");
  EXPECT_EQ(error_of("inf", number), "a.csv:3: column b: 'inf' is not finite");
  EXPECT_EQ(error_of("2.5", integer), "a.csv:3: column b: '2.5' is not a whole number");
  EXPECT_EQ(error_of("10", integer), "a.csv:3: column b: '10' is not between 1 and 9");
  EXPECT_EQ(error_of("-1", integer), "a.csv:3: column b: '-1' is not between 1 and 9");
  EXPECT_EQ(error_of("7.0", integer), "");
  EXPECT_EQ(error_of("+7", number), "");
  EXPECT_NE(error_of("+-7", number), "");
  EXPECT_NE(error_of("0x10", number), "");
}

TEST(CsvRow, KeepsTheFirstError) {
  const CsvTable table = Parsed("a,b\nx,y\n");
  CsvRow row(table, 0);
  row.Number("a");
  row.Number("b");
  EXPECT_EQ(row.error()->text, "a.csv:2: column a: 'x' is not a number");
}

TEST(NumberText, ReadsBackAsTheSameNumber) {
  const std::uint64_t seed = testing::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 20'000; ++k) {
    const auto value = std::bit_cast<double>(rng.Bits());
    if (!std::isfinite(value) || value == 0) continue;
    if (std::abs(value) < std::numeric_limits<double>::min()) continue;
    const CsvTable table = Parsed("a\n" + NumberText(value) + "\n");
    CsvRow row(table, 0);
    EXPECT_EQ(row.Number("a"), value) << NumberText(value);
  }
  EXPECT_EQ(NumberText(1.2345), "1.2345");
  EXPECT_EQ(NumberText(-0.0), "0");
  EXPECT_EQ(NumberText(std::nan("")), "");
}

TEST(CsvWriter, WhatIsWrittenReadsBack) {
  CsvWriter csv({"id", "name", "x"});
  csv.Integer(-5).Text("a \"b\", c\n# d").Number(0.1).EndRow();
  csv.Missing().Text("#not a comment").Number(std::nan("")).EndRow();
  const CsvTable table = Parsed(csv.Take());
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(CsvRow(table, 0).Text("name"), "a \"b\", c\n# d");
  EXPECT_EQ(CsvRow(table, 1).Text("name"), "#not a comment");
  EXPECT_FALSE(CsvRow(table, 1).Has("id"));
  EXPECT_FALSE(CsvRow(table, 1).Has("x"));
}

TEST(Csv, CutAnywhereItIsRefusedOrEndsWithAWholeLine) {
  const std::string whole = "# c\nunit_id,x_mm,name\n1,2.25,\"a\nb\"\n2,3.5,c\n";
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto table = CsvTable::Parse(whole.substr(0, size), "a.csv");
    if (table) {
      EXPECT_EQ(whole[size - 1], '\n') << size;
    } else {
      EXPECT_TRUE(table.error().text.starts_with("a.csv:")) << table.error().text;
    }
  }
}

}  // namespace
}  // namespace focalfleet
