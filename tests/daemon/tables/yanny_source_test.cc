#include "daemon/tables/yanny_source.h"

#include <gtest/gtest.h>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

constexpr const char* kHead =
    "#%yanny\n"
    "mjd 60426\n"
    "typedef enum {\n A,\n B\n} KIND;\n"
    "typedef struct {\n"
    "  short unit_id; # the robot\n"
    "  char name[28];\n"
    "  KIND kind;\n"
    "  float mag[2];\n"
    "  char words[2][8];\n"
    "} FIBERMAP;\n";

std::string ErrorOf(const std::string& rows) {
  const auto file = ReadYannySource(kHead + rows, "a.par");
  return file ? "" : file.error().text;
}

TEST(YannySource, ReadsStructsKeysArraysAndQuotes) {
  const auto file = ReadYannySource(std::string(kHead) +
                                        "FIBERMAP 1 \"a b\" A {1.5 2} {x \"y z\"}\n"
                                        "\n# a comment\n"
                                        "fibermap 2 {} B {3 \\\n 4} {p q}\n",
                                    "a.par");
  ASSERT_TRUE(file) << file.error().text;
  ASSERT_EQ(file->tables.size(), 1u);
  const SourceTable& table = file->tables[0];
  EXPECT_EQ(table.name, "FIBERMAP");
  EXPECT_EQ(table.places, (std::vector<int>{14, 17}));
  ASSERT_EQ(table.keys.size(), 1u);
  EXPECT_EQ(table.keys[0].second, "60426");
  const auto csv = CsvTable::Parse(TextOf(table), "a.par");
  ASSERT_TRUE(csv) << csv.error().text;
  CsvRow first(*csv, 0);
  EXPECT_EQ(first.Text("name"), "a b");
  EXPECT_EQ(first.Number("mag_1"), 2);
  EXPECT_EQ(first.Text("words_1"), "y z");
  CsvRow second(*csv, 1);
  EXPECT_EQ(second.Text("name"), "");
  EXPECT_EQ(second.Number("mag_1"), 4);
  EXPECT_EQ(second.line(), 17);
}

TEST(YannySource, RefusesRowsThatDoNotFitWithTheirLine) {
  EXPECT_EQ(ErrorOf("FIBERMAP 1 a A {1 2}\n"),
            "a.par:14: FIBERMAP: the row ends before field words");
  EXPECT_EQ(ErrorOf("FIBERMAP 1 a A {1 2} {x y} 7\n"),
            "a.par:14: FIBERMAP: more values than fields, from '7' on");
  EXPECT_EQ(ErrorOf("FIBERMAP 1 a A {1 2 3} {x y}\n"), "a.par:14: field mag: more than 2 elements");
  EXPECT_EQ(ErrorOf("FIBERMAP 1 a A {1} {x y}\n"), "a.par:14: field mag: 1 elements are not 2");
  EXPECT_EQ(ErrorOf("FIBERMAP 1 \"a A\n"),
            "a.par:14: FIBERMAP: the row ends before field name (a quote or brace is not closed)");
  EXPECT_EQ(ErrorOf("typedef struct {\n int a;\n"),
            "a.par:14: a definition does not end: the file is cut short");
  EXPECT_FALSE(ReadYannySource("#%yanny\nkey 1\n", "a.par"));
  EXPECT_EQ(
      ErrorOf("FIBERMAP 1 a A {1 2} {x y}"),
      "a.par:14: the last line does not end: the file is cut short (or end it with a newline)");
}

TEST(YannySource, IsRecognisedByItsFirstDefinition) {
  EXPECT_TRUE(IsYanny("#%yanny\n"));
  EXPECT_TRUE(IsYanny("# made by hand\n\ntypedef struct {\n"));
  EXPECT_FALSE(IsYanny("# a table\nunit_id,x_mm\n"));
  EXPECT_FALSE(IsYanny(""));
}

}  // namespace
}  // namespace focalfleet
