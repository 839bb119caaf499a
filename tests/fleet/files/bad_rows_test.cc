#include "fleet/files/bad_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string Row(int k) { return "t.csv:" + std::to_string(k) + ": wrong"; }

std::string Reported(const BadRows& bad) {
  const Status checked = bad.Check();
  return checked ? "" : checked.error().text;
}

TEST(BadRows, OneIsOneLine) {
  BadRows bad;
  EXPECT_TRUE(bad.empty());
  EXPECT_TRUE(bad.Check());
  bad.Add("t.csv:2: unit 1: unknown unit", "unknown unit");
  EXPECT_EQ(Reported(bad), "t.csv:2: unit 1: unknown unit");
  EXPECT_EQ(bad.Check().error().code, ErrorCode::kInvalid);
}

TEST(BadRows, TheFirstAreReportedAndTheOthersCountedByTheirKind) {
  BadRows bad;
  constexpr int kFirst = limits::kBadRowsReported;
  const std::string first = std::to_string(kFirst);
  for (int k = 1; k <= kFirst; ++k) bad.Add(Row(k), "out of patrol");
  std::string text = Reported(bad);
  EXPECT_THAT(text, StartsWith("t.csv:1: wrong\n  t.csv:2: wrong\n"));
  EXPECT_THAT(text, HasSubstr("\n  t.csv:" + first + ": wrong"));
  EXPECT_THAT(text, Not(HasSubstr("more")));
  bad.Add(Row(kFirst + 1), "unknown unit");
  EXPECT_THAT(Reported(bad), HasSubstr("\n  and 1 more row; all " + std::to_string(kFirst + 1) +
                                       ": out of patrol (" + first + "), unknown unit (1)"));
  for (int k = 2; k <= 3387; ++k) bad.Add(Row(kFirst + k), "unknown unit");
  text = Reported(bad);
  EXPECT_THAT(text, HasSubstr("\n  and 3387 more rows; all " + std::to_string(kFirst + 3387) +
                              ": unknown unit (3387), out of patrol (" + first + ")"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), kFirst);
}

TEST(BadRows, CellsNeitherMakeLinesNorFillTheText) {
  BadRows bad;
  bad.Add("t.csv:2: 'a\nt.csv:3: forged\x1b[2J'", "a\nb");
  EXPECT_EQ(Reported(bad), "t.csv:2: 'a?t.csv:3: forged?[2J'");
  BadRows long_ones;
  for (int k = 0; k < 1000; ++k)
    long_ones.Add("t.csv:2: " + std::string(100'000, 'x'),
                  std::to_string(k) + std::string(100'000, 'y'));
  EXPECT_LT(Reported(long_ones).size(), 12'000u);
  EXPECT_THAT(Reported(long_ones), HasSubstr("other reasons"));
  BadRows umlauts;
  for (const std::size_t shift : {std::size_t{0}, std::size_t{1}})
    umlauts.Add(std::string(shift, 'x') + std::string(400, '\xc3'), "");  // no whole character
  umlauts.Add(
      "x" +
          [] {
            std::string text;
            for (int k = 0; k < 400; ++k) text += "\xc3\xa4";
            return text;
          }(),
      "");
  EXPECT_THAT(Reported(umlauts), HasSubstr("\xc3\xa4..."));
}

TEST(BadRows, ALogIsReportedTheFirstAndHowManyFollow) {
  BadRows bad;
  bad.Add(Row(1), "");
  EXPECT_EQ(FirstRow(Reported(bad)), "t.csv:1: wrong");
  bad.Add(Row(2), "");
  bad.Add(Row(3), "");
  EXPECT_EQ(FirstRow(Reported(bad)), "t.csv:1: wrong (and 2 more)");
}

}  // namespace
}  // namespace focalfleet
