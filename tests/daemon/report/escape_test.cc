#include "daemon/report/escape.h"

#include <gtest/gtest.h>

#include <string>

namespace focalfleet::report {
namespace {

const std::string kReplacement = "\xEF\xBF\xBD";

TEST(EscapeMarkup, LeavesNothingThatOpensATagOrEndsAnAttribute) {
  EXPECT_EQ(EscapeMarkup(R"(<b a="1" c='2'>&amp;)"),
            "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;amp;");
  EXPECT_EQ(EscapeMarkup("20 \xC2\xB5m, 10\xE2\x81\xBB\xC2\xB3"),
            "20 \xC2\xB5m, 10\xE2\x81\xBB\xC2\xB3");
  EXPECT_EQ(EscapeMarkup(""), "");
}

TEST(EscapeMarkup, ReplacesControlCharactersExceptWhiteSpace) {
  for (int c = 0; c < 0x20; ++c) {
    const std::string text(1, static_cast<char>(c));
    const bool kept = c == '\t' || c == '\n' || c == '\r';
    EXPECT_EQ(EscapeMarkup(text), kept ? text : kReplacement) << c;
  }
  EXPECT_EQ(EscapeMarkup("\x7F"), kReplacement);
  EXPECT_EQ(EscapeMarkup("\xEF\xBF\xBF"), kReplacement) << "U+FFFF";
}

TEST(EscapeMarkup, ReplacesBytesThatAreNotUtf8OneByOne) {
  EXPECT_EQ(EscapeMarkup("a\xFF"), "a" + kReplacement);
  EXPECT_EQ(EscapeMarkup("\xC3"), kReplacement) << "cut short";
  EXPECT_EQ(EscapeMarkup("\xC3<"), kReplacement + "&lt;") << "what follows is not swallowed";
  EXPECT_EQ(EscapeMarkup("\xC0\xBC"), kReplacement + kReplacement) << "a long '<'";
  EXPECT_EQ(EscapeMarkup("\xE0\x80\xBC"), kReplacement + kReplacement + kReplacement);
  EXPECT_EQ(EscapeMarkup("\xED\xA0\x80"), kReplacement + kReplacement + kReplacement)
      << "a surrogate";
  EXPECT_EQ(EscapeMarkup("\xF0\x9F\x98\x80"), "\xF0\x9F\x98\x80");
}

TEST(Shorten, CutsBetweenCharactersAndSaysSo) {
  EXPECT_EQ(Shorten("abc", 3), "abc");
  EXPECT_EQ(Shorten("abcd", 3), "ab\xE2\x80\xA6");
  EXPECT_EQ(Shorten("\xC2\xB5\xC2\xB5\xC2\xB5", 2), "\xC2\xB5\xE2\x80\xA6");
  EXPECT_EQ(CountCharacters("\xC2\xB5m"), 2u);
}

}  // namespace
}  // namespace focalfleet::report
