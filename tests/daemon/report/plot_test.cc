#include "daemon/report/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/daemon/report/markup.h"

namespace focalfleet::report {
namespace {

using test::MarkupElement;
using test::ReadMarkup;
using test::Select;
using test::TextOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Numbers = std::vector<double>;

std::vector<MarkupElement> Read(const Svg& svg) {
  auto elements = ReadMarkup(svg.text);
  EXPECT_TRUE(elements.has_value()) << svg.text;
  if (!elements) return {};
  for (const MarkupElement& element : *elements) {
    for (const char* number : {"d", "x", "y", "width", "height"}) {
      const auto attribute = element.attributes.find(number);
      if (attribute == element.attributes.end()) continue;
      EXPECT_THAT(attribute->second, Not(::testing::ContainsRegex("nan|inf|e"))) << svg.text;
    }
  }
  return *elements;
}

std::string Texts(const Svg& svg) { return TextOf(Select(Read(svg), "text")); }

Svg Lines(const Numbers& x, const Numbers& y, LinePlot plot = {}) {
  plot.series.push_back({.name = "a", .x = x, .y = y});
  return DrawLines(plot);
}

TEST(LinePlot, HasItsWordsAndOnePathASeries) {
  const Numbers x{0, 1, 2};
  const Numbers y{0, 4, 1};
  const LinePlot plot{.title = "Current",
                      .x = {.label = "time", .unit = "s"},
                      .y = {.label = "current", .unit = "A"},
                      .series = {{.name = "phase a", .x = x, .y = y},
                                 {.name = "phase b", .x = x, .y = x, .style = Style::kSteps},
                                 {.name = "peaks", .x = x, .y = y, .style = Style::kDots}}};
  const Svg svg = DrawLines(plot);
  const auto elements = Read(svg);
  EXPECT_EQ(Select(elements, "path", "line").size(), 2u);
  EXPECT_EQ(Select(elements, "path", "dots").size(), 2u) << "one in the legend";
  for (const char* word :
       {"Current\n", "time (s)\n", "current (A)\n", "phase a\n", "phase b\n", "peaks\n"}) {
    EXPECT_THAT(TextOf(elements), HasSubstr(word));
  }
  EXPECT_EQ(svg.text, DrawLines(plot).text);
}

TEST(LinePlot, EscapesEveryText) {
  const std::string evil = "<script>&\"'\xFF";
  const Numbers x{0, 1};
  const auto elements =
      Read(DrawLines({.title = evil,
                      .x = {.label = evil, .unit = evil},
                      .y = {.label = evil, .unit = evil},
                      .series = {{.name = evil, .x = x, .y = x}},
                      .horizontal = {{.value = 0.5, .label = evil}, {.value = kNan, .label = evil}},
                      .vertical = {{.value = 0.5, .label = evil}}}));
  EXPECT_TRUE(Select(elements, "script").empty());
  const std::string texts = TextOf(elements);
  std::size_t seen = 0;
  for (std::size_t at = texts.find("<script>&\"'"); at != std::string::npos;
       at = texts.find("<script>&\"'", at + 1)) {
    ++seen;
  }
  EXPECT_EQ(seen, 9u) << texts;
}

TEST(LinePlot, KeepsANarrowPeakOfALongSeries) {
  Numbers x;
  Numbers y;
  for (int i = 0; i < 1000000; ++i) {
    x.push_back(i * 1e-6);
    y.push_back(std::sin(i * 1e-3));
  }
  y[123456] = 7;
  LinePlot plot;
  plot.y.min = -8.0;
  plot.y.max = 8.0;
  const Svg svg = Lines(x, y, plot);
  EXPECT_LT(svg.text.size(), 60000u);
  const std::string path = Select(Read(svg), "path", "line").at(0).attributes.at("d");
  // The value 7 on an axis of -8 to 8, in 240 pixels from the top.
  EXPECT_THAT(path, HasSubstr(",15.00L"));
}

TEST(LinePlot, BreaksAtNan) {
  const Svg svg = Lines({0, 1, 2, 3, 4}, {0, 1, kNan, 1, 0});
  const std::string path = Select(Read(svg), "path", "line").at(0).attributes.at("d");
  EXPECT_EQ(std::count(path.begin(), path.end(), 'M'), 2);
  EXPECT_THAT(Texts(svg), Not(HasSubstr("Not shown")));
}

TEST(LinePlot, SaysWhatItLeavesOut) {
  LinePlot log;
  log.y.log = true;
  const Svg svg = Lines({1, 2, 3, 4, 5}, {1, 0, -5, kInfinity, 100}, log);
  EXPECT_THAT(Texts(svg),
              HasSubstr("Not shown: points with a value ≤ 0 on a logarithmic axis (2)."));
  EXPECT_THAT(Texts(svg), HasSubstr("Not shown: points with an infinite value (1)."));
  const std::string path = Select(Read(svg), "path", "line").at(0).attributes.at("d");
  EXPECT_EQ(std::count(path.begin(), path.end(), 'M'), 2);

  LinePlot references;
  references.y.max = 2.0;
  references.horizontal = {{.value = 3, .label = "limit"}, {.value = 1, .label = "usual"}};
  const Svg outside = Lines({0, 1}, {0, 1}, references);
  EXPECT_THAT(Texts(outside), HasSubstr("Outside the axes: limit at 3."));
  EXPECT_EQ(Select(Read(outside), "path", "ref").size(), 1u);
}

TEST(LinePlot, IsDrawnWithoutData) {
  EXPECT_THAT(Texts(DrawLines({})), HasSubstr("no data"));
  const Svg empty = Lines({}, {});
  EXPECT_THAT(Texts(empty), HasSubstr("a (no data)"));
  EXPECT_THAT(Texts(Lines({0, 1}, {kNan, kNan})), HasSubstr("a (no data)"));
  LinePlot log;
  log.x.log = log.y.log = true;
  EXPECT_THAT(Texts(Lines({0, -1}, {1, 1}, log)), HasSubstr("no data"));
}

// Data that are equal, huge, tiny or far from zero, and ends given against the data, all give an
// axis with ticks.
TEST(LinePlot, HasTicksForAnyData) {
  const std::vector<Numbers> data = {
      {5, 5},      {0, 0},           {-3, -3},          {1e299, -1e299},
      {1e-299, 0}, {1e-310, 2e-310}, {1e9, 1e9 + 1e-6}, {1e16, 1e16 + 2}};
  const std::vector<std::pair<std::optional<double>, std::optional<double>>> ends = {
      {{}, {}}, {10.0, {}}, {{}, 0.001}, {1.0, 1.0 + 1e-15}, {2.0, 3.0}};
  for (const Numbers& y : data) {
    for (const auto& [min, max] : ends) {
      for (const bool log : {false, true}) {
        LinePlot plot;
        plot.y = {.log = log, .min = min, .max = max};
        const auto elements = Read(Lines({0, 1}, y, plot));
        EXPECT_GE(Select(elements, "path", "grid").size(), 7u)
            << y[0] << " " << y[1] << " " << min.value_or(kNan) << " " << log;
      }
    }
  }
}

TEST(LinePlot, BeginsAtZeroWhereDataDo) {
  const Svg svg = Lines({0, 1}, {0, 10});
  const std::string path = Select(Read(svg), "path", "line").at(0).attributes.at("d");
  EXPECT_THAT(path, HasSubstr("M0.00,240.00L")) << "no empty band below zero";
}

TEST(LinePlot, TellsSeriesApartByColourThenByDashes) {
  const Numbers x{0, 1};
  LinePlot plot;
  for (int i = 0; i < 21; ++i) plot.series.push_back({.name = "s", .x = x, .y = x});
  std::set<std::string> classes;
  for (const MarkupElement& path : Select(Read(DrawLines(plot)), "path", "line")) {
    classes.insert(path.attributes.at("class"));
    std::istringstream words(path.attributes.at("class"));
    for (std::string word; words >> word;) {
      EXPECT_THAT(std::string(PlotStyle()), HasSubstr("." + word)) << "a class without a style";
    }
  }
  EXPECT_EQ(classes.size(), 21u);
}

TEST(BarPlot, StandsOnZeroAndSkipsNan) {
  const Svg svg = DrawBars({.categories = {"<a>", "b"},
                            .y = {.label = "power", .unit = "mW", .min = -2.0, .max = 2.0},
                            .groups = {{.name = "x", .values = {1, -1}},
                                       {.name = "y", .values = {kNan, 5}},
                                       {.name = "z", .values = {kNan, kInfinity}}},
                            .horizontal = {{.value = 1.5, .label = "limit"}},
                            .height_px = 200});
  const auto elements = Read(svg);
  EXPECT_THAT(TextOf(elements), HasSubstr("<a>, x: 1\n"));
  EXPECT_THAT(TextOf(elements), HasSubstr("z (no data)"));
  EXPECT_THAT(TextOf(elements), HasSubstr("Not shown: bars with an infinite value (1)."));
  std::vector<MarkupElement> bars = Select(elements, "rect", "bar");
  bars.erase(bars.begin(), bars.begin() + 3);  // the legend's
  ASSERT_EQ(bars.size(), 3u);
  EXPECT_EQ(bars[0].attributes.at("y"), "50.00");
  EXPECT_EQ(bars[0].attributes.at("height"), "50.00");
  EXPECT_EQ(bars[1].attributes.at("y"), "100.00");
  EXPECT_EQ(bars[1].attributes.at("height"), "50.00");
}

TEST(BarPlot, StandsManyAndLongCategories) {
  BarPlot plot{.categories = std::vector<std::string>(5000, std::string(80, 'W')),
               .groups = {{.values = Numbers(5000, 1.0)}}};
  const auto elements = Read(DrawBars(plot));
  EXPECT_EQ(Select(elements, "rect", "bar").size(), 5000u);
  EXPECT_LT(Select(elements, "text").size(), 60u);
  EXPECT_THAT(Texts(DrawBars({})), HasSubstr("no data"));
}

TEST(Histogram, OutlinesItsBins) {
  const Svg svg = DrawHistogram({.x = {.label = "error", .unit = "µm"},
                                 .y = {.label = "units", .min = 0.0, .max = 4.0},
                                 .edges = {0, 1, 2, 3, 4},
                                 .counts = {1, 2, kNan, 4},
                                 .vertical = {{.value = 2.5, .label = "limit"}},
                                 .height_px = 100});
  const std::string path = Select(Read(svg), "path", "area").at(0).attributes.at("d");
  EXPECT_EQ(std::count(path.begin(), path.end(), 'M'), 2);
  EXPECT_THAT(path, ::testing::StartsWith("M0.00,100.00V75.00H"));
  EXPECT_THAT(path, HasSubstr("V50.00H"));
  EXPECT_THAT(path, ::testing::EndsWith("V100.00Z"));
  EXPECT_THAT(Texts(svg), HasSubstr("error (µm)"));
  EXPECT_THAT(Texts(DrawHistogram({})), HasSubstr("no data"));
}

TEST(Histogram, LeavesOutBinsThatALogarithmicAxisCannotShow) {
  const Svg svg =
      DrawHistogram({.x = {.log = true}, .edges = {0, 1, 10, kInfinity}, .counts = {3, 4, 5}});
  EXPECT_THAT(Texts(svg), HasSubstr("Not shown: bins with a value ≤ 0 on a logarithmic axis (1)."));
  EXPECT_THAT(Texts(svg), HasSubstr("Not shown: bins with an infinite value (1)."));
}

TEST(PlotDeathTest, RefusesWhatMeansNothing) {
  const Numbers one{1};
  EXPECT_DEATH(DrawLines({.series = {{.x = one, .y = {}}}}), "check failed");
  EXPECT_DEATH(DrawLines({.y = {.log = true, .min = 0.0}}), "check failed");
  EXPECT_DEATH(DrawLines({.y = {.min = 2.0, .max = 1.0}}), "check failed");
  EXPECT_DEATH(DrawBars({.y = {.log = true}}), "check failed");
  EXPECT_DEATH(DrawBars({.categories = {"a"}, .groups = {{.values = {}}}}), "check failed");
  EXPECT_DEATH(DrawHistogram({.edges = {0, 1}, .counts = {}}), "check failed");
  EXPECT_DEATH(DrawHistogram({.edges = {1, 0}, .counts = {1}}), "check failed");
}

}  // namespace
}  // namespace focalfleet::report
