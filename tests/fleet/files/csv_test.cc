#include "fleet/files/csv.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "fleet/files/cell.h"
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
  EXPECT_EQ(ErrorOf(std::string_view("a\n1\n\0\n", 6)), "a.csv:3: not a text file (byte 0x00)");
  EXPECT_EQ(ErrorOf("a\x1f\n"), "a.csv:1: not a text file (byte 0x1f)");
  EXPECT_EQ(ErrorOf("unit_id;x_mm\n1;2,5\n"),
            "a.csv:1: the header 'unit_id;x_mm' is one column: cells are to be separated by "
            "commas");
}

TEST(Csv, TellsAllRowsOfAnotherWidth) {
  EXPECT_EQ(ErrorOf("a,b\n1\n1,2\n1,2,3\n"),
            "a.csv:2: 1 cells, but the header has 2 columns: cut short?\n"
            "  a.csv:4: 3 cells, but the header has 2 columns");
}

TEST(Csv, ColumnsWithoutANameArePassedOver) {
  // The index that pandas writes, and the columns that a spreadsheet adds behind the last one.
  const CsvTable table = Parsed(",unit_id,Unnamed: 0,x_mm,Unnamed: 0.1,,\n0,7,0,2.5,0,,\n");
  ASSERT_EQ(table.size(), 1u);
  CsvRow row(table, 0);
  EXPECT_EQ(row.Integer("unit_id", {0, 9}), 7);
  EXPECT_EQ(row.Number("x_mm"), 2.5);
  EXPECT_FALSE(row.Has("Unnamed: 0"));
  EXPECT_FALSE(row.Has(""));
  EXPECT_FALSE(row.error());
  EXPECT_EQ(table.Others({"unit_id", "x_mm"}),
            (std::vector<std::string>{"column 1 (no name)", "Unnamed: 0", "Unnamed: 0.1",
                                      "column 6 (no name)", "column 7 (no name)"}));
  EXPECT_EQ(table.Require({"y_mm"}).error().text,
            "a.csv:1: column y_mm is missing; there are: column 1 (no name), unit_id, Unnamed: 0, "
            "x_mm, Unnamed: 0.1, column 6 (no name), column 7 (no name)");
  EXPECT_EQ(ErrorOf("Unnamed: 0,Unnamed: 0\n1,2\n"), "");
  EXPECT_TRUE(Parsed("Unnamed: x\n1\n").Find("Unnamed: x")) << "a name of somebody's own";
}

TEST(Csv, LinesOfCommasAloneAreEmptyLines) {
  const CsvTable table = Parsed(",,\na,b,c\n,,\n1,2,3\n , ,\t\n,,\n");
  ASSERT_EQ(table.size(), 1u);
  EXPECT_EQ(table.line(0), 4);
}

// A header of n columns once cost n^2: minutes for a line that a client may send.
TEST(Csv, LimitsColumnsAndTheLengthOfARow) {
  std::string header = "c0";
  for (int k = 1; k < 1024; ++k) header += ",c" + std::to_string(k);
  const CsvTable widest = Parsed(header + "\n");
  EXPECT_EQ(widest.columns().size(), 1024u);
  EXPECT_EQ(widest.Find("c1023"), 1023u);
  EXPECT_EQ(ErrorOf(header + ",c1024\n"), "a.csv:1: more than 1024 columns");
  std::string million = "c";
  for (int k = 0; k < 1'000'000; ++k) million += ",c" + std::to_string(k);
  EXPECT_EQ(ErrorOf(million + "\n"), "a.csv:1: more than 1024 columns");
  EXPECT_EQ(ErrorOf("a,b\n" + std::string(2000, ',') + "1\n"), "a.csv:2: more than 1024 cells");
  const std::string long_cell(1 << 20, 'x');
  EXPECT_EQ(ErrorOf("a,b\n1," + long_cell + "\n"),
            "a.csv:2: the row is longer than 1024 KiB: is a quote not closed?");
  EXPECT_EQ(ErrorOf("a,b\n1,\"" + long_cell + "\n\"\n"),
            "a.csv:2: the row is longer than 1024 KiB: is a quote not closed?");
  EXPECT_EQ(ErrorOf("# " + long_cell + "\na\n1\n"), "") << "a comment may be long";
}

TEST(Csv, ReadersAreReportedOfAllRowsThatTheyRejected) {
  const CsvTable table = Parsed("a,b\n1,x\n2,2\n3,y\n4,4\n");
  std::vector<double> good;
  const Status read = table.ReadRows([&](CsvRow& row) {
    const double b = row.Number("b");
    if (row.error()) return;
    if (b == 4) return row.RejectRow("four", "four");
    good.push_back(b);
  });
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().text,
            "a.csv:2: column b: 'x' is not a number\n  a.csv:4: column b: 'y' is not a number\n"
            "  a.csv:5: four");
  EXPECT_EQ(good, std::vector<double>{2});
}

TEST(Csv, RejectedCellsAreCountedByColumnAndReason) {
  std::string text = "a\n";
  for (int k = 0; k < 30; ++k) text += "word" + std::to_string(k) + "\n";
  for (int k = 0; k < 5; ++k) text += std::to_string(k) + ".5\n";
  const Status read = Parsed(text).ReadRows([](CsvRow& row) { row.Integer("a", {0, 100}); });
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text.find("and 15 more rows; all 35: column a: is not a number (30), "
                                   "column a: is not a whole number (5)"),
            std::string::npos)
      << read.error().text;
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

TEST(CsvRow, ReadsFlagsAsNumbersAndAsOthersWriteThem) {
  const auto flag = [](const std::string& cell) {
    const CsvTable table = Parsed("a,b\n1," + cell + "\n");
    CsvRow row(table, 0);
    const auto value = row.FlagIfAny("b");
    return row.error() ? row.error()->text : !value ? "missing" : *value ? "1" : "0";
  };
  for (const char* yes : {"1", "1.0", "True", "true", "TRUE", "T", "t", "\"True\""})
    EXPECT_EQ(flag(yes), "1") << yes;
  for (const char* no : {"0", "0.0", "-0", "False", "false", "FALSE", "F", "f"})
    EXPECT_EQ(flag(no), "0") << no;
  EXPECT_EQ(flag(""), "missing");
  EXPECT_EQ(flag("nan"), "missing");
  for (const char* wrong : {"2", "0.5", "-1", "yes", "truely", "inf"})
    EXPECT_EQ(flag(wrong), "a.csv:2: column b: '" + std::string(wrong) +
                               "' is neither 0 nor 1 (nor false nor true)");
}

TEST(CsvRow, WholeNumbersEndWhereNeighboursAreTheSameDouble) {
  for (const char* cell : {"9223372036854775808", "1e300", "9007199254740994"}) {
    const CsvTable table = Parsed("a\n" + std::string(cell) + "\n");
    CsvRow row(table, 0);
    row.Integer("a", {0, INT64_MAX});
    ASSERT_TRUE(row.error()) << cell;
    EXPECT_NE(row.error()->text.find("is not between 0 and 9007199254740992"), std::string::npos);
  }
}

TEST(Cell, NumbersFlagsAndWordsAreDistinct) {
  for (const char* cell : {"", "nan", "NaN"}) EXPECT_EQ(KindOf(cell), CellKind::kMissing) << cell;
  for (const char* cell : {"1", "-2.5e3", "+7"}) EXPECT_EQ(KindOf(cell), CellKind::kNumber) << cell;
  for (const char* cell : {"True", "F"}) EXPECT_EQ(KindOf(cell), CellKind::kFlag) << cell;
  for (const char* cell : {"arc", "1,5", "0x10", "inf", "2026-03-17", "1 2"})
    EXPECT_EQ(KindOf(cell), CellKind::kWord) << cell;
}

TEST(CsvRow, KeepsTheFirstError) {
  const CsvTable table = Parsed("a,b\nx,y\n");
  CsvRow row(table, 0);
  row.Number("a");
  row.Number("b");
  EXPECT_EQ(row.error()->text, "a.csv:2: column a: 'x' is not a number");
}

TEST(NumberText, ReadsBackAsTheSameNumber) {
  const std::uint64_t seed = test::TestSeed(3);
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
