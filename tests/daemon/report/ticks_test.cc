#include "daemon/report/ticks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::report {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> Labels(const Ticks& ticks) {
  std::vector<std::string> labels;
  for (const Tick& tick : ticks.marks) labels.push_back(tick.label);
  return labels;
}

TEST(LinearTicks, HaveTheDigitsThatTheyNeed) {
  EXPECT_THAT(Labels(LinearTicks({0, 1}, 6)),
              ElementsAre("0.0", "0.2", "0.4", "0.6", "0.8", "1.0"));
  EXPECT_THAT(Labels(LinearTicks({-0.3, 0.3}, 7)),
              ElementsAre("-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"));
  EXPECT_THAT(Labels(LinearTicks({0, 100}, 5)), ElementsAre("0", "50", "100"));
  EXPECT_THAT(Labels(LinearTicks({1.7, 9.2}, 5)), ElementsAre("2", "4", "6", "8"));
  EXPECT_THAT(Labels(LinearTicks({1000.001, 1000.003}, 3)),
              ElementsAre("1000.001", "1000.002", "1000.003"));
}

TEST(LinearTicks, ShareAFactorWhereNumbersAreLargeOrSmall) {
  const Ticks small = LinearTicks({0, 4e-6}, 5);
  EXPECT_EQ(small.exponent, -6);
  EXPECT_THAT(Labels(small), ElementsAre("0", "1", "2", "3", "4"));
  const Ticks large = LinearTicks({-2e6, 0}, 5);
  EXPECT_EQ(large.exponent, 6);
  EXPECT_THAT(Labels(large), ElementsAre("-2.0", "-1.5", "-1.0", "-0.5", "0.0"));
}

// Ticks of any range are multiples of 1, 2 or 5, evenly apart and inside. There are as many as
// allowed, but not needlessly few, and a label read back is the value.
TEST(LinearTicks, AreRegularForRandomRanges) {
  const std::uint64_t seed = test::TestSeed(4711);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 20000; ++i) {
    const double middle = (rng.Uniform() - 0.5) * std::pow(10.0, 20 * rng.Uniform() - 10);
    const double span = std::pow(10.0, 20 * rng.Uniform() - 10);
    if (span < 1e-9 * std::abs(middle)) continue;
    const Range range{middle - span / 2, middle + span / 2};
    const int count_max = 2 + static_cast<int>(rng.Uniform() * 12);
    const Ticks ticks = LinearTicks(range, count_max);
    const auto count = static_cast<int>(ticks.marks.size());
    ASSERT_GE(count, std::max(1, count_max / 3)) << range.low << " " << range.high;
    ASSERT_LE(count, count_max);
    for (const Tick& tick : ticks.marks) {
      ASSERT_GE(tick.value, range.low - 1e-6 * span);
      ASSERT_LE(tick.value, range.high + 1e-6 * span);
      ASSERT_NEAR(std::stod(tick.label) * std::pow(10.0, ticks.exponent), tick.value,
                  1e-9 * span + 1e-13 * std::abs(middle));
    }
    if (count < 2) continue;
    const double step = ticks.marks[1].value - ticks.marks[0].value;
    const double mantissa = step / std::pow(10.0, std::floor(std::log10(step * 1.000001)));
    ASSERT_TRUE(std::abs(mantissa - 1) < 1e-5 || std::abs(mantissa - 2) < 1e-5 ||
                std::abs(mantissa - 5) < 1e-5)
        << mantissa;
  }
}

TEST(LinearTicks, StandTheExtremes) {
  EXPECT_FALSE(LinearTicks({-kPlottableMax, kPlottableMax}, 8).marks.empty());
  EXPECT_FALSE(LinearTicks({0, 1e-289}, 8).marks.empty());
}

TEST(LogTicks, AreDecadesOrWithinThem) {
  EXPECT_THAT(Labels(LogTicks({1, 100}, 8)), ElementsAre("1", "2", "5", "10", "20", "50", "100"));
  EXPECT_THAT(Labels(LogTicks({0.01, 1000}, 9)),
              ElementsAre("0.01", "0.1", "1", "10", "100", "1000"));
  EXPECT_THAT(Labels(LogTicks({1e-9, 1}, 5)), ElementsAre("10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"));
  EXPECT_THAT(Labels(LogTicks({1e-4, 1e-3}, 5)), ElementsAre("10⁻⁴", "2·10⁻⁴", "5·10⁻⁴", "10⁻³"));
}

TEST(LogTicks, AreLinearWithinLessThanADecade) {
  EXPECT_THAT(Labels(LogTicks({3, 4}, 6)), ElementsAre("3.0", "3.2", "3.4", "3.6", "3.8", "4.0"));
}

TEST(PowerOfTen, IsWrittenRaised) {
  EXPECT_EQ(PowerOfTen(-12), "10⁻¹²");
  EXPECT_EQ(PowerOfTen(30), "10³⁰");
}

}  // namespace
}  // namespace focalfleet::report
