#include "daemon/tables/json_source.h"

#include <gtest/gtest.h>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

CsvTable TableOf(const std::string& text) {
  const auto file = ReadJsonSource(text, "a.json");
  EXPECT_TRUE(file) << file.error().text;
  auto table = CsvTable::Parse(file ? TextOf(file->tables[0]) : "x\n", "a.json");
  EXPECT_TRUE(table) << table.error().text;
  return std::move(*table);
}

TEST(JsonSource, EveryFormGivesTheSameTable) {
  for (const char* text :
       {R"([{"unit_id": 1, "x_mm": 0.5}, {"unit_id": 2, "x_mm": null, "more": true}])",
        R"({"version": 3, "units": [{"unit_id": 1, "x_mm": 0.5}, {"unit_id": 2, "more": true}]})",
        R"({"unit_id": [1, 2], "x_mm": [0.5, null], "more": [null, true]})",
        R"({"columns": ["unit_id", "x_mm", "more"], "data": [[1, 0.5, null], [2, null, true]]})",
        R"({"a": {"unit_id": 1, "x_mm": 0.5}, "b": {"unit_id": 2, "more": true}})"}) {
    const CsvTable table = TableOf(text);
    ASSERT_EQ(table.size(), 2u) << text;
    CsvRow first(table, 0);
    CsvRow second(table, 1);
    EXPECT_EQ(first.Number("unit_id"), 1) << text;
    EXPECT_EQ(first.Number("x_mm"), 0.5) << text;
    EXPECT_FALSE(second.Has("x_mm")) << text;
    EXPECT_EQ(second.FlagIfAny("more"), true) << text;
    EXPECT_EQ(table.ErrorAt(1, "why").text, "a.json: row 2: why") << text;
  }
}

TEST(JsonSource, NamesOfObjectsAndInnerMembersAreColumns) {
  const CsvTable table = TableOf(R"({"M1": {"at": {"x": 1, "y": [2, 3]}}})");
  CsvRow row(table, 0);
  EXPECT_EQ(row.Text("key"), "M1");
  EXPECT_EQ(row.Number("at.x"), 1);
  EXPECT_EQ(row.Number("at.y_1"), 3);
}

TEST(JsonSource, RefusesWhatIsNoTable) {
  EXPECT_EQ(ReadJsonSource("[1, 2", "a.json").error().text, "a.json: not JSON, byte 6");
  for (const char* text : {"[]", "[1, 2]", "{}", "{\"a\": 1}", "3", R"({"a": [1], "b": [1, 2]})"})
    EXPECT_FALSE(ReadJsonSource(text, "a.json")) << text;
  const std::string deep = std::string(2'000'000, '[') + std::string(2'000'000, ']');
  const auto error_of = [](const std::string& text) {
    const auto file = ReadJsonSource(text, "a.json");
    return file ? std::string("a table") : file.error().text;
  };
  EXPECT_EQ(error_of(deep), "a.json: nested too deep, byte 65");
  EXPECT_EQ(error_of("[{\"a\": " + deep + "}]"), "a.json: nested too deep, byte 70");
  EXPECT_TRUE(ReadJsonSource("[{\"a\": \"" + std::string(100, '[') + "\"}]", "a.json"));
  EXPECT_EQ(ReadJsonSource("[{\"x\": 1e400}]", "a.json").error().text,
            "a.json: a number that no column can hold");
}

}  // namespace
}  // namespace focalfleet
