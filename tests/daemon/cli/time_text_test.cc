#include "daemon/cli/time_text.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/control/id_ranges.h"

namespace focalfleet::cli {
namespace {

constexpr WallTime kNow{1'795'737'600'000'000'000};  // 2026-11-27T00:00:00Z

TEST(TimeText, SpansHaveUnits) {
  EXPECT_EQ(*SecondsOf("90"), 90);
  EXPECT_EQ(*SecondsOf("1.5s"), 1.5);
  EXPECT_EQ(*SecondsOf("30m"), 1800);
  EXPECT_EQ(*SecondsOf("2h"), 7200);
  EXPECT_EQ(*SecondsOf("7d"), 604'800);
  for (const char* bad : {"", "h", "0", "-1h", "2 h", "2w", "nan", "inf", "1e300d", "2h30m"})
    EXPECT_FALSE(SecondsOf(bad)) << bad;
}

TEST(TimeText, InstantsAreOfUtcOrBeforeNow) {
  EXPECT_EQ(InstantOf("2h", kNow)->ns, kNow.ns - 7'200'000'000'000);
  for (const char* same : {"2026-11-27", "2026-11-27T00:00", "2026-11-27 00:00Z",
                           "2026-11-27T00:00:00Z", "2026-11-27T00:00:00.000Z"})
    EXPECT_EQ(InstantOf(same, {})->ns, kNow.ns) << same;
  EXPECT_EQ(InstantOf("2026-11-26T23:59:59.500Z", {})->ns, kNow.ns - 500'000'000);
  EXPECT_EQ(InstantOf(ToIso8601(kNow), {})->ns, kNow.ns) << "as answers show it";
  for (const char* bad : {"2026-02-30", "2026-11-27T", "2026-11-27T24:00", "2026-11-27T1:2:3:4",
                          "2026-11-27T00:00:00+01:00", "2026-11-27x", "1969-01-01", "noon"})
    EXPECT_FALSE(InstantOf(bad, kNow)) << bad;
}

TEST(IdRanges, AreReadInTheirOrder) {
  using Numbers = std::vector<std::uint32_t>;
  EXPECT_EQ(*ParseRanges("7"), Numbers({7}));
  EXPECT_EQ(*ParseRanges("1,5-7,4294967295"), Numbers({1, 5, 6, 7, 4294967295u}));
  for (const char* bad : {"", "1,", "-1", "x", "5-3", "1-4294967295", "4294967296", "1 2"})
    EXPECT_FALSE(ParseRanges(bad)) << bad;
}

TEST(IdRanges, AreShownAscendingAndShort) {
  EXPECT_EQ(DescribeRanges({}, 3), "");
  EXPECT_EQ(DescribeRanges({9, 7, 8, 7, 20, 21, 30}, 9), "7-9,20,21,30");
  EXPECT_EQ(DescribeRanges({1, 3, 5, 7}, 2), "1,3,...");
  EXPECT_EQ(*ParseRanges(DescribeRanges({4, 5, 6, 1}, 9)),
            (std::vector<std::uint32_t>{1, 4, 5, 6}));
}

}  // namespace
}  // namespace focalfleet::cli
