#include "daemon/report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/daemon/report/markup.h"

namespace focalfleet::report {
namespace {

using test::ReadMarkup;
using test::Select;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Page Example() {
  static const std::vector<double> kX{0, 1, 2};
  Page page("Drive <1>");
  page.Heading("Power & peaks")
      .Paragraph("a < b")
      .Table({"unit", "power"}, {{"B12/34", "12.3"}, {"<b>", "4"}}, {Align::kLeft, Align::kRight})
      .Plot(DrawLines({.title = "p", .series = {{.x = kX, .y = kX}}}), "Caption & more");
  return page;
}

TEST(Page, IsWellFormedAndHoldsEverythingInOrder) {
  const std::string html = Example().Html();
  EXPECT_THAT(html, StartsWith("<!DOCTYPE html>\n<html "));
  const auto elements = ReadMarkup(html);
  ASSERT_TRUE(elements.has_value()) << html;
  EXPECT_EQ(Select(*elements, "title").at(0).text, "Drive <1>");
  EXPECT_EQ(Select(*elements, "h1").at(0).text, "Drive <1>");
  EXPECT_EQ(Select(*elements, "h2").at(0).text, "Power & peaks");
  EXPECT_EQ(Select(*elements, "p").at(0).text, "a < b");
  EXPECT_EQ(Select(*elements, "td").size(), 4u);
  EXPECT_EQ(Select(*elements, "td").at(2).text, "<b>");
  EXPECT_EQ(Select(*elements, "td", "right").size(), 2u);
  EXPECT_EQ(Select(*elements, "th", "right").at(0).text, "power");
  EXPECT_EQ(Select(*elements, "svg", "plot").size(), 1u);
  EXPECT_EQ(Select(*elements, "figcaption").at(0).text, "Caption & more");
  EXPECT_LT(html.find("<h2>"), html.find("<table>"));
  EXPECT_LT(html.find("<table>"), html.find("<figure>"));
}

TEST(Page, NeedsNothingElse) {
  const std::string html = Example().Html();
  for (const char* foreign : {"<script", "<link", "<img", "@import", "url(", "http:", "https:"}) {
    EXPECT_THAT(html, Not(HasSubstr(foreign)));
  }
  // Nor may a text that it shows make a browser fetch or run anything.
  EXPECT_THAT(html, HasSubstr("default-src 'none'; style-src 'unsafe-inline'"));
}

TEST(Page, IsTheSameForTheSameCalls) { EXPECT_EQ(Example().Html(), Example().Html()); }

TEST(Page, IsWellFormedWhenEmpty) {
  EXPECT_TRUE(ReadMarkup(Page("").Html()).has_value());
  EXPECT_TRUE(ReadMarkup(Page("t").Table({}, {}).Plot(DrawLines({})).Html()).has_value());
}

TEST(PageDeathTest, RefusesATableWhoseRowsDoNotFit) {
  EXPECT_DEATH(Page("t").Table({"a"}, {{"1", "2"}}), "check failed");
  EXPECT_DEATH(Page("t").Table({}, {}, {Align::kLeft}), "check failed");
}

TEST(ReadMarkup, IsStrict) {
  EXPECT_TRUE(ReadMarkup(R"(<a b="1">x &lt; <c/></a>)").has_value());
  for (const char* bad :
       {"", "text", "<a>", "<a></b>", "<a><b></a></b>", "<a b=1></a>", "<a>&x</a>", R"(<a b="<"/>)",
        R"(<a b="1" b="2"/>)", "<a/><b/>", "<a>x < y</a>"}) {
    EXPECT_FALSE(ReadMarkup(bad).has_value()) << bad;
  }
}

}  // namespace
}  // namespace focalfleet::report
