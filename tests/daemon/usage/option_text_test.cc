#include "daemon/usage/option_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace focalfleet::usage {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class OptionTexts : public ::testing::Test {
 protected:
  CLI::App app_{"", "ship"};
  unsigned count_ = 0;
  double length_ = 1.5;
  std::string text_;
  std::vector<unsigned> numbers_;
  bool flag_ = false;
};

TEST_F(OptionTexts, ARangeIsInWords) {
  const auto text = TextOf(*app_.add_option("-c,--count", count_)->check(CLI::Range(0, 10)));
  EXPECT_EQ(text.names, "-c, --count");
  EXPECT_EQ(text.value, "N");
  EXPECT_THAT(text.remarks, ElementsAre("N from 0 to 10"));
  EXPECT_THAT(TextOf(*app_.add_option("--far", length_)->check(CLI::Range(0.5, 1e6))).remarks,
              ElementsAre("NUMBER from 0.5 to 1000000"));
  EXPECT_THAT(TextOf(*app_.add_option("--any", length_)->check(CLI::PositiveNumber)).remarks,
              ElementsAre("NUMBER above 0"));
  EXPECT_THAT(TextOf(*app_.add_option("--most", length_)->check(CLI::Range(1.0, 1e300))).remarks,
              ElementsAre("NUMBER from 1"));
}

TEST_F(OptionTexts, RequiredAndDefaultAreRemarks) {
  const auto text =
      TextOf(*app_.add_option("--length", length_, "How long")->required()->capture_default_str());
  EXPECT_EQ(Described(text), "How long (required; default 1.5)");
  EXPECT_EQ(Described({.description = "How far (default: by the pitch)", .remarks = {"required"}}),
            "How far (default: by the pitch; required)");
}

TEST_F(OptionTexts, ChoicesAreWords) {
  EXPECT_EQ(TextOf(*app_.add_option("--mode", text_)->type_name("{get,set}")).value, "get|set");
  const auto text = TextOf(*app_.add_option("--name", text_)
                                ->type_name("{counter1,repeat,subdivision,min_position,mode}"));
  EXPECT_EQ(text.value, "WORD");
  EXPECT_THAT(text.remarks,
              ElementsAre("one of counter1, repeat, subdivision, min_position, mode"));
}

TEST_F(OptionTexts, AFlagHasNoValueAndAnArgumentHasItsName) {
  EXPECT_EQ(TextOf(*app_.add_flag("--fixed", flag_)).value, "");
  const auto text = TextOf(*app_.add_option("UNIT", numbers_)->required());
  EXPECT_EQ(text.names, "UNIT...");
  EXPECT_EQ(text.value, "");
  EXPECT_THAT(text.remarks, ElementsAre("required"));
}

TEST_F(OptionTexts, NeedsAndExclusionsAreNamed) {
  CLI::Option* fixed = app_.add_flag("--fixed", flag_);
  CLI::Option* count = app_.add_option("--count", count_)->needs(fixed);
  EXPECT_THAT(TextOf(*count).remarks, ElementsAre("with --fixed"));
  CLI::Option* other = app_.add_flag("--other", flag_)->excludes(count);
  EXPECT_THAT(TextOf(*other).remarks, ElementsAre("not with --count"));
  EXPECT_THAT(TextOf(*fixed).remarks, IsEmpty());
}

TEST_F(OptionTexts, TheSynopsisNamesAllThatIsRequired) {
  app_.add_option("--out", text_)->required()->type_name("FILE");
  app_.add_option("UNIT", numbers_)->required();
  app_.add_option("WORD", text_);
  EXPECT_EQ(SynopsisOf(app_), "ship --out FILE [OPTIONS] UNIT... [WORD]");
}

}  // namespace
}  // namespace focalfleet::usage
