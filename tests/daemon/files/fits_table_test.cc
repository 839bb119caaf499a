#include "daemon/files/fits_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

FitsTable Small() {
  return {.name = "SMALL",
          .keys = {{"EXPID", std::string("night 3, field 4"), "a name"},
                   {"DATE-OBS", std::string("2026-11-22T03:04:05.678Z"), "UTC"}},
          .columns = {{"UNIT_ID", "", std::vector<std::int64_t>{1, 5'000'000'000, -7}},
                      {"X_MM", "mm", std::vector<double>{0.1, -1e300, 2.3e-308}},
                      {"NOTE", "", std::vector<std::string>{"a", "", "longer"}}}};
}

TEST(FitsTable, ReadsBackToTheBit) {
  const test::ScratchFolder folder;
  const std::string path = folder / "small.fits";
  ASSERT_TRUE(WriteFitsTable(path, Small()));
  const auto back = ReadFitsTable(path);
  ASSERT_TRUE(back) << back.error().text;
  EXPECT_EQ(back->name, "SMALL");
  EXPECT_EQ(back->rows(), 3u);
  for (const FitsColumn& column : Small().columns) {
    const FitsColumn* found = back->Find(column.name);
    ASSERT_NE(found, nullptr) << column.name;
    EXPECT_EQ(found->unit, column.unit);
    EXPECT_EQ(found->values, column.values) << column.name;
  }
  ASSERT_NE(back->FindKey("EXPID"), nullptr);
  EXPECT_EQ(std::get<std::string>(back->FindKey("EXPID")->value), "night 3, field 4");
}

TEST(FitsTable, AnotherTableTakesThePlaceOfTheFirstAtOnce) {
  const test::ScratchFolder folder;
  const std::string path = folder / "small.fits";
  FitsTable table = Small();
  ASSERT_TRUE(WriteFitsTable(path, table));
  table.columns[1].values = std::vector<double>{std::nan(""), 2, 3};
  ASSERT_TRUE(WriteFitsTable(path, table));
  const auto back = ReadFitsTable(path);
  ASSERT_TRUE(back);
  const auto& x = std::get<std::vector<double>>(back->Find("x_mm")->values);
  EXPECT_TRUE(std::isnan(x[0]));
  EXPECT_EQ(x[2], 3);
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
}

TEST(FitsTable, SaysWhatIsNoTable) {
  const test::ScratchFolder folder;
  EXPECT_EQ(ReadFitsTable(folder / "none.fits").error().code, ErrorCode::kUnavailable);
  const std::string path = folder / "text.fits";
  std::ofstream(path) << "unit_id,x_mm\n1,2\n";
  const auto read = ReadFitsTable(path);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().text, HasSubstr("text.fits"));
  // Filters of an extended file name are not run.
  EXPECT_FALSE(ReadFitsTable(path + "[1][col x=1]"));
  EXPECT_FALSE(WriteFitsTable(folder / "no/such/folder.fits", Small()));
}

}  // namespace
}  // namespace focalfleet
