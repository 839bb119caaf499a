#include "daemon/report/trace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::report {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string Draw(const std::vector<Pixel>& pixels, Style style = Style::kLine) {
  Trace trace({.style = style, .points_expected = pixels.size(), .width_px = 100, .height_px = 50});
  for (const Pixel pixel : pixels) trace.Add(pixel);
  return trace.Finish();
}

// Returns the points of a path of M and L.
std::vector<Pixel> Points(std::string path) {
  std::replace_if(
      path.begin(), path.end(), [](char c) { return c == 'M' || c == 'L' || c == ','; }, ' ');
  std::istringstream in(path);
  std::vector<Pixel> points;
  for (Pixel p; in >> p.x >> p.y;) points.push_back(p);
  return points;
}

TEST(Trace, WritesShortSeriesPointByPoint) {
  EXPECT_EQ(Draw({{0, 1}, {2.5, 3}, {4, 0}}), "M0.00,1.00L2.50,3.00L4.00,0.00");
  EXPECT_EQ(Draw({{0, 1}, {2, 3}}, Style::kSteps), "M0.00,1.00H2.00V3.00");
  EXPECT_EQ(Draw({{0, 1}, {2, 3}}, Style::kDots), "M0.00,1.00h0M2.00,3.00h0");
  EXPECT_EQ(Draw({}), "");
}

TEST(Trace, BreaksAtGapsAndKeepsALonePointVisible) {
  EXPECT_EQ(Draw({{0, 1}, {1, 1}, {kNan, 1}, {3, 1}, {4, kNan}, {5, 1}, {6, 1}}),
            "M0.00,1.00L1.00,1.00M3.00,1.00h0M5.00,1.00L6.00,1.00");
  EXPECT_EQ(Draw({{kNan, 1}, {1, kNan}}), "");
  EXPECT_EQ(Draw({{0, 1}, {kNan, 1}, {2, 2}}, Style::kSteps), "M0.00,1.00h0M2.00,2.00h0");
}

// The oracle bins the same points by column on its own.
TEST(Trace, KeepsTheExtremesOfEveryColumnOfALongSeries) {
  const std::uint64_t seed = test::TestSeed(4711);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  struct Extremes {
    double low = 1e9, high = -1e9;
  };
  std::map<int, Extremes> expected;
  std::vector<Pixel> pixels;
  for (int i = 0; i < 200000; ++i) {
    // The point stays inside its column also when rounded to two digits.
    const int column_of_p = i / 2000;
    Pixel p{column_of_p + 0.01 + i % 2000 * 0.98 / 2000, 25 + 5 * std::sin(i * 0.01)};
    if (rng.Below(5000) == 0) p.y = rng.Uniform(0, 50);  // one sample wide
    pixels.push_back(p);
    Extremes& column = expected[static_cast<int>(std::floor(p.x))];
    column.low = std::min(column.low, p.y);
    column.high = std::max(column.high, p.y);
  }
  const std::vector<Pixel> points = Points(Draw(pixels));
  EXPECT_LE(points.size(), 400u);
  std::map<int, Extremes> drawn;
  for (const Pixel& p : points) {
    Extremes& column = drawn[static_cast<int>(std::floor(p.x))];
    column.low = std::min(column.low, p.y);
    column.high = std::max(column.high, p.y);
  }
  ASSERT_EQ(drawn.size(), expected.size());
  for (const auto& [column, extremes] : expected) {
    EXPECT_NEAR(drawn[column].low, extremes.low, 0.006) << column;
    EXPECT_NEAR(drawn[column].high, extremes.high, 0.006) << column;
  }
}

TEST(Trace, KeepsGapsAndOrderOfALongSeries) {
  std::vector<Pixel> pixels;
  pixels.reserve(100001);
  for (int i = 0; i < 100000; ++i) pixels.push_back({i * 1e-3, i % 2 == 0 ? 10.0 : 40.0});
  pixels[50000].y = kNan;
  const std::string path = Draw(pixels);
  EXPECT_EQ(std::count(path.begin(), path.end(), 'M'), 2);
  const std::vector<Pixel> points = Points(path);
  EXPECT_TRUE(std::is_sorted(points.begin(), points.end(),
                             [](const Pixel& a, const Pixel& b) { return a.x < b.x; }));
}

TEST(Trace, StaysShortWhereALongSeriesLeavesTheArea) {
  std::vector<Pixel> pixels;
  pixels.reserve(100001);
  for (int i = 0; i < 100000; ++i) pixels.push_back({i - 50000.0, 1e12 * i});
  const std::string path = Draw(pixels);
  EXPECT_LT(path.size(), 102u * 4 * 24);
  EXPECT_EQ(path.find('e'), std::string::npos);
}

TEST(Trace, DrawsADotOnceAPixel) {
  std::vector<Pixel> pixels;
  pixels.reserve(100001);
  for (int i = 0; i < 100000; ++i) pixels.push_back({50 + 1e-6 * i, 20});
  pixels.push_back({50, 45});
  pixels.push_back({150, 45});
  EXPECT_EQ(Draw(pixels, Style::kDots), "M50.00,20.00h0M50.00,45.00h0");
}

TEST(Trace, WritesNoNegativeZero) { EXPECT_EQ(Draw({{-0.001, -0.0}}), "M0.00,0.00h0"); }

}  // namespace
}  // namespace focalfleet::report
