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
}

TEST(Csv, SemicolonsTabsAndBlanksSeparateCellsWhereNoCommaDoes) {
  const CsvTable semicolons = Parsed("unit_id;x_mm;\"a;b\"\n1;2,5;\"c;d\"\n;;\n2;-1,5D1;\n");
  ASSERT_EQ(semicolons.size(), 2u);
  EXPECT_EQ(CsvRow(semicolons, 0).Number("x_mm"), 2.5) << "a decimal comma";
  EXPECT_EQ(CsvRow(semicolons, 1).Number("x_mm"), -15);
  EXPECT_EQ(CsvRow(semicolons, 0).Text("a;b"), "c;d");
  const CsvTable tabs = Parsed("unit_id\tx_mm\tname\n1\t\ta b\n");
  EXPECT_FALSE(CsvRow(tabs, 0).Has("x_mm"));
  EXPECT_EQ(CsvRow(tabs, 0).Text("name"), "a b");
  const CsvTable blanks = Parsed("unit_id  x_mm\n   1     2\n\n10 3  \n");
  ASSERT_EQ(blanks.size(), 2u);
  EXPECT_EQ(CsvRow(blanks, 1).Number("x_mm"), 3);
  const CsvTable commas = Parsed("unit_id,a;b\n1,2;3\n");
  EXPECT_EQ(CsvRow(commas, 0).Text("a;b"), "2;3") << "a semicolon beside commas is part of a name";
  EXPECT_EQ(CsvRow(Parsed("a\rb\r"), 0).Text("a"), "b") << "lines of an old Macintosh";
}

TEST(Csv, EmptyCellsBehindTheLastColumnArePassedOver) {
  const CsvTable table = Parsed("a,b\n1,2,,\n3,,\n");
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(CsvRow(table, 0).Number("b"), 2);
  EXPECT_FALSE(CsvRow(table, 1).Has("b"));
  EXPECT_EQ(ErrorOf("a,b\n1,2,,3\n"), "a.csv:2: 4 cells, but the header has 2 columns");
}

TEST(Csv, NumbersOfFortranAndWordsForMissingOnesAreKnown) {
  const CsvTable table = Parsed("a,b,c,d,e\n1.5D+03,-2d-1,1D,D5,1.5E+03\nNULL,n/a,--,None,<NA>\n");
  CsvRow row(table, 0);
  EXPECT_EQ(row.Number("a"), 1500);
  EXPECT_EQ(row.Number("b"), -0.2);
  EXPECT_EQ(row.Number("e"), 1500);
  EXPECT_FALSE(row.error());
  for (const char* wrong : {"c", "d"}) {
    CsvRow other(table, 0);
    other.Number(wrong);
    EXPECT_TRUE(other.error()) << wrong;
  }
  for (const char* column : {"a", "b", "c", "d", "e"}) EXPECT_FALSE(CsvRow(table, 1).Has(column));
}

TEST(Csv, DeclaredUnitsAreConvertedToThoseOfTheNames) {
  const CsvTable table = Parsed(
      "# %ECSV 1.0\n# ---\n# datatype:\n# - {name: x_mm, unit: m, datatype: float64}\n"
      "# - name: theta_deg\n#   unit: 'rad'\n# - {name: temp_C, unit: K}\n"
      "# - {name: t_s, unit: furlong}\n# - {name: y_mm, unit: deg, description: 'a, b'}\n"
      "# - {name: count, unit: m}\n# - {name: z_mm, unit: mm}\n"
      "x_mm,theta_deg,temp_C,t_s,y_mm,count,z_mm\n0.5,3.141592653589793,280,1,2,3,4\n");
  CsvRow row(table, 0);
  EXPECT_DOUBLE_EQ(row.Number("x_mm"), 500);
  EXPECT_DOUBLE_EQ(row.Number("theta_deg"), 180);
  EXPECT_DOUBLE_EQ(row.Number("temp_C"), 280 - 273.15);
  EXPECT_EQ(row.Number("count"), 3) << "a name without a unit";
  EXPECT_EQ(row.NumberIn("count", "um"), 3e6);
  EXPECT_EQ(row.Number("z_mm"), 4);
  EXPECT_EQ(row.NumberOrFlagIfAny("y_mm"), 2) << "an unknown column is taken as it stands";
  EXPECT_FALSE(row.error());
  row.Number("y_mm");
  ASSERT_TRUE(row.error());
  EXPECT_EQ(row.error()->text,
            "a.csv:13: column y_mm: its unit is 'deg', which cannot be converted to mm");
  CsvRow other(table, 0);
  other.Number("t_s");
  EXPECT_TRUE(other.error()) << "a unit that nobody knows";
}

TEST(Csv, NamesInCapitalsAreKnownInSmallLetters) {
  const CsvTable table = Parsed("UNIT_ID,X_MM,V_BUS_V,pos_T,x_mm\n1,2,3,4,5\n");
  CsvRow row(table, 0);
  EXPECT_EQ(row.Number("unit_id"), 1);
  EXPECT_EQ(row.Number("UNIT_ID"), 1);
  EXPECT_EQ(row.Number("v_bus_V"), 3);
  EXPECT_EQ(row.Number("x_mm"), 5) << "the column of that very name";
  EXPECT_EQ(row.Number("X_MM"), 2);
  EXPECT_FALSE(row.Has("pos_t"));
  EXPECT_EQ(table.Others({"unit_id", "v_bus_V", "x_mm"}),
            (std::vector<std::string>{"X_MM", "pos_T"}));
}

TEST(Csv, PlacesOfAnotherFileAreNamedInMessages) {
  const CsvTable table = Parsed("# %ECSV 1.0\n#@ -1\na,b\n#@ -1\n1,2\n#@ 40\n3,x\n");
  EXPECT_EQ(table.line(0), -1);
  EXPECT_EQ(table.ErrorAt(0, "why").text, "a.csv: row 1: why");
  EXPECT_EQ(table.ErrorAt(1, "why").text, "a.csv:40: why");
  EXPECT_EQ(table.Require({"c"}).error().text, "a.csv: column c is missing; there are: a, b");
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
