#include "daemon/report/plate_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/daemon/report/markup.h"

namespace focalfleet::report {
namespace {

using test::ReadMarkup;
using test::Select;
using test::TextOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(PlateMap, HasAPathAClassAndCounts) {
  const PlateMap map{.title = "rms <1>",
                     .unit = "um",
                     .limits = {1, 2, 5, 10, 20},
                     .units = {{0, 0, 0.5}, {10, 0, 1}, {0, 10, 1.5}, {10, 10, 99}, {5, 5, kNan}}};
  const std::string svg = DrawPlateMap(map).text;
  const auto elements = ReadMarkup(svg);
  ASSERT_TRUE(elements) << svg;
  EXPECT_EQ(Select(*elements, "path", "spots").size(), 4u) << svg;
  const std::string texts = TextOf(Select(*elements, "text"));
  EXPECT_THAT(texts, HasSubstr("rms <1> (um)"));
  EXPECT_THAT(texts, HasSubstr("below 1: 1\n"));
  EXPECT_THAT(texts, HasSubstr("1 to 2: 2\n"));
  EXPECT_THAT(texts, HasSubstr("from 20: 1\n"));
  EXPECT_THAT(texts, HasSubstr("not known: 1\n"));
  EXPECT_THAT(svg, Not(::testing::ContainsRegex("[^a-z]nan|inf"))) << svg;
}

TEST(PlateMap, ShowsTheSkySide) {
  const auto map = [](double x_mm, double y_mm) {
    return DrawPlateMap({.title = "m",
                         .unit = "",
                         .limits = {1, 2, 5, 10, 20},
                         .units = {{0, 0, 0}, {x_mm, y_mm, 100}}})
        .text;
  };
  const auto place = [](const std::string& svg) {
    const auto elements = ReadMarkup(svg);
    EXPECT_TRUE(elements) << svg;
    const std::string d = Select(*elements, "path", "q5").at(0).attributes.at("d");
    return std::pair(std::stod(d.substr(1)), std::stod(d.substr(d.find(',') + 1)));
  };
  EXPECT_GT(place(map(10, 0)).first, 190) << "x goes to the right";
  EXPECT_LT(place(map(0, 10)).second, 190) << "y goes upwards";
}

TEST(PlateMap, IsDrawnOfNoneAndOfOne) {
  for (const std::vector<PlateValue>& units :
       {std::vector<PlateValue>{}, std::vector<PlateValue>{{3, 4, 5}}}) {
    const std::string svg =
        DrawPlateMap({.title = "m", .unit = "", .limits = {1, 2, 3, 4, 5}, .units = units}).text;
    EXPECT_TRUE(ReadMarkup(svg)) << svg;
    EXPECT_THAT(svg, Not(::testing::ContainsRegex("[^a-z]nan|inf"))) << svg;
  }
}

TEST(PlateLimits, AreRoundAndAscend) {
  std::vector<double> values;
  for (int k = 0; k < 100; ++k) values.push_back(0.4 * k);
  EXPECT_THAT(PlateLimits(values), ElementsAre(2, 5, 10, 20, 50));
  EXPECT_EQ(PlateLimits({}).size(), kPlateClasses - 1);
  EXPECT_EQ(PlateLimits({kNan, 0, 0}).size(), kPlateClasses - 1);
}

TEST(PlateArrows, AreCutAndSayWhatIsLeftOut) {
  const std::string svg =
      DrawPlateArrows(
          {.title = "move 3",
           .scale_um = 10,
           .units = {{0, 0, 10, 0}, {10, 0, 0, -5}, {0, 10, 1e5, 0}, {10, 10, kNan, 0}}})
          .text;
  const auto elements = ReadMarkup(svg);
  ASSERT_TRUE(elements) << svg;
  const std::string texts = TextOf(Select(*elements, "text"));
  EXPECT_THAT(texts, HasSubstr("10 um\n"));
  EXPECT_THAT(texts, HasSubstr("1 longer than 60 um are cut."));
  EXPECT_THAT(svg, Not(::testing::ContainsRegex("[^a-z]nan|inf"))) << svg;
}

}  // namespace
}  // namespace focalfleet::report
