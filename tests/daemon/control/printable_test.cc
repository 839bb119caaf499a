#include "daemon/control/printable.h"

#include <gtest/gtest.h>

#include "daemon/control/messages.h"

namespace focalfleet {
namespace {

TEST(Printable, KeepsTextOfAllTongues) {
  const std::string text = "unit 7: \xc2\xb5m \xe2\x82\xac \xf0\x9f\x94\xad \\n \xd7\xa9";
  EXPECT_EQ(Printable(text), text);
  EXPECT_EQ(PrintableLines(text), text);
}

TEST(Printable, MakesOneLineWithoutControlCharacters) {
  EXPECT_EQ(Printable("a\nb\r\tc"), "a\\nb\\r\\tc");
  EXPECT_EQ(Printable(std::string_view("\x1b[2J\0\x7f", 6)), "\\x1b[2J\\x00\\x7f");
  EXPECT_EQ(PrintableLines("a\nb\x1b"), "a\nb\\x1b");
}

TEST(Printable, EscapesC1DirectionMarksAndLineSeparators) {
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\x9b31m")
      << "an escape sequence's begin in one character";
  EXPECT_EQ(Printable("\xe2\x80\xae"
                      "abc"),
            "\\u202eabc");
  EXPECT_EQ(Printable("\xe2\x80\xa8\xe2\x81\xa6"), "\\u2028\\u2066");
}

TEST(Printable, EscapesEveryByteThatIsNoText) {
  EXPECT_EQ(Printable("\x9b\xff\xc0\xaf"), "\\x9b\\xff\\xc0\\xaf");
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(Printable("\xe2\x82"), "\\xe2\\x82") << "cut short";
}

TEST(Printable, LeavesNoControlCharacterOfAnyTwoBytes) {
  for (int a = 0; a < 256; ++a)
    for (int b = 0; b < 256; ++b) {
      const std::string text = {static_cast<char>(a), static_cast<char>(b)};
      const std::string clean = Printable(text);
      for (std::size_t i = 0; i < clean.size(); ++i) {
        const auto byte = static_cast<unsigned char>(clean[i]);
        ASSERT_GE(byte, 0x20) << a << " " << b;
        ASSERT_NE(byte, 0x7f) << a << " " << b;
      }
      ASSERT_EQ(Printable(clean), clean) << a << " " << b;
    }
}

TEST(Printable, JsonKeepsItsValue) {
  const Json sent = {{"text", "a\x7f\xc2\x9b\xe2\x80\xae\n"}};
  const std::string line = PrintableJson(sent.dump());
  EXPECT_EQ(line, R"({"text":"a\u007f\u009b\u202e\n"})");
  EXPECT_EQ(Json::parse(line), sent);
}

}  // namespace
}  // namespace focalfleet
