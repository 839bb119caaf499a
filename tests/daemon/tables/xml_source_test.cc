#include "daemon/tables/xml_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

std::string ErrorOf(const std::string& text) {
  const auto file = ReadXmlSource(text, "a.xml");
  return file ? "" : file.error().text;
}

std::vector<std::string> FirstColumn(const SourceFile& file) {
  return std::get<std::vector<std::string>>(file.tables.at(0).columns.at(0).values);
}

TEST(XmlSource, RepeatedElementsAreRowsAndWhatStandsBelowAreCells) {
  const auto file = ReadXmlSource(
      "<?xml version=\"1.0\"?>\n<ROOT>\n<NAME>n</NAME>\n"
      "<ROW kind=\"a\">\n<HEAD><Id> 1 </Id></HEAD><BODY><x>1.5</x><Id>7</Id></BODY></ROW>\n"
      "<ROW><HEAD><Id>2</Id></HEAD><BODY><x/></BODY></ROW>\n</ROOT>",
      "a.xml");
  ASSERT_TRUE(file) << file.error().text;
  ASSERT_EQ(file->tables.size(), 1u);
  EXPECT_EQ(file->tables[0].name, "ROW");
  EXPECT_EQ(file->tables[0].keys[0].second, "n");
  const auto table = CsvTable::Parse(TextOf(file->tables[0]), "a.xml");
  ASSERT_TRUE(table);
  CsvRow first(*table, 0);
  EXPECT_EQ(first.Text("kind"), "a");
  EXPECT_EQ(first.Number("Id"), 1);
  EXPECT_EQ(first.Number("BODY.Id"), 7);
  CsvRow second(*table, 1);
  EXPECT_FALSE(second.Has("x"));
  EXPECT_EQ(second.line(), 6);
}

TEST(XmlSource, ListsOfOneNameAreOneTable) {
  const auto file = ReadXmlSource(
      "<R><ring><o><Id>1</Id></o><o><Id>2</Id></o></ring><ring><o><Id>3</Id></o></ring></R>",
      "a.xml");
  ASSERT_TRUE(file) << file.error().text;
  ASSERT_EQ(file->tables.size(), 1u);
  EXPECT_EQ(file->tables[0].name, "o");
  EXPECT_THAT(FirstColumn(*file), ::testing::ElementsAre("1", "2", "3"));
}

TEST(XmlSource, ASingleElementIsARow) {
  const auto file = ReadXmlSource("<R><ROW><H><Id>1</Id></H><B><x>2</x></B></ROW></R>", "a.xml");
  ASSERT_TRUE(file);
  ASSERT_EQ(file->tables.size(), 1u);
  EXPECT_EQ(file->tables[0].columns.size(), 2u);
}

TEST(XmlSource, VoTablesHaveUnits) {
  const auto file = ReadXmlSource(
      "<VOTABLE><RESOURCE><TABLE name=\"t\">\n<FIELD name=\"x_mm\" unit=\"m\"/><FIELD "
      "name=\"n\"/>\n"
      "<DATA><TABLEDATA>\n<TR><TD>0.5</TD><TD>a</TD></TR>\n</TABLEDATA></DATA></TABLE></RESOURCE>"
      "</VOTABLE>",
      "a.vot");
  ASSERT_TRUE(file) << file.error().text;
  const auto table = CsvTable::Parse(TextOf(file->tables[0]), "a.vot");
  ASSERT_TRUE(table);
  CsvRow row(*table, 0);
  EXPECT_EQ(row.Number("x_mm"), 500);
  EXPECT_EQ(row.line(), 4);
}

TEST(XmlSource, VoTablesHaveNullsAndPrefixes) {
  const auto file = ReadXmlSource(
      "<v:VOTABLE><v:TABLE><v:FIELD name=\"n\"><v:VALUES null=\"0\"/></v:FIELD>"
      "<v:DATA><v:TABLEDATA><v:TR><v:TD>0</v:TD></v:TR><v:TR><v:TD>7</v:TD></v:TR>"
      "</v:TABLEDATA></v:DATA></v:TABLE></v:VOTABLE>",
      "a.vot");
  ASSERT_TRUE(file) << file.error().text;
  EXPECT_THAT(FirstColumn(*file), ::testing::ElementsAre("", "7"));
}

TEST(XmlSource, RefusesWithLineAndReason) {
  const auto of_form = [](const std::string& form) {
    return "<VOTABLE><TABLE><FIELD name=\"n\"/>\n<DATA>" + form + "</DATA></TABLE></VOTABLE>";
  };
  EXPECT_THAT(ErrorOf(of_form("<BINARY2><STREAM>AAAA</STREAM></BINARY2>")),
              HasSubstr("a.xml:2: a VOTable in BINARY2 is not read"));
  EXPECT_THAT(ErrorOf(of_form("<TABLEDATA><TR><TD>1</TD><TD>2</TD></TR></TABLEDATA>")),
              HasSubstr("a.xml:2: 2 cells for 1 columns"));
  EXPECT_THAT(ErrorOf("<a>\n<b>\n</a>"), HasSubstr("a.xml:3: mismatched tag"));
  EXPECT_THAT(ErrorOf("<a><b>1</b></a>"), HasSubstr("no table in this XML file"));
  EXPECT_THAT(ErrorOf("<!DOCTYPE a [<!ENTITY b \"cc\">]>\n<a>&b;</a>"),
              HasSubstr("entities of its own are not read"));
  std::string deep;
  for (int k = 0; k < 100; ++k) deep += "<a>";
  EXPECT_THAT(ErrorOf(deep), HasSubstr("elements are nested too deep"));
}

}  // namespace
}  // namespace focalfleet
