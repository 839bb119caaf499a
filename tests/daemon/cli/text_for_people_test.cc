// The progress bar and the tables by themselves.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>

#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

TEST(ProgressBar, DrawsTheFractionAndClipsWhatIsOutside) {
  EXPECT_EQ(cli::DrawBar(0.5, "half", 80), "[##############--------------]  50 %  half");
  EXPECT_EQ(cli::DrawBar(-1, "", 80), cli::DrawBar(0, "", 80));
  EXPECT_EQ(cli::DrawBar(7, "", 80), cli::DrawBar(1, "", 80));
  EXPECT_EQ(cli::DrawBar(std::nan(""), "", 80), cli::DrawBar(0, "", 80));
  EXPECT_EQ(cli::DrawBar(0.5, "a very long text", 20).size(), 20u);
}

TEST(Table, FlattensObjectsAndAlignsRows) {
  EXPECT_EQ(cli::DescribeObject(Json{{"a", 1}, {"b", {{"c", 0.5}, {"d", nullptr}}}}),
            "a    1\nb.c  0.5\nb.d  -");
  EXPECT_EQ(cli::DescribeRows(Json{{{"z", 1}, {"a", "x"}}, {{"z", true}}}, {"z"}),
            "z    a\n1    x\nyes  -");
  EXPECT_EQ(cli::DescribeRows(Json::array(), {}), "");
  EXPECT_EQ(cli::DescribeRows(Json{1, 2}, {}), "");
}

TEST(Table, ARowStaysOneLineOfText) {
  EXPECT_EQ(cli::AlignColumns({{"a\nb", "\x1b[2J"}, {"c", "d"}}), "a\\nb  \\x1b[2J\nc     d");
  EXPECT_EQ(cli::DescribeObject(Json{{"a", "b\nc  d"}}), "a  b\\nc  d");
}

TEST(TextFile, AcceptsUtf8AndNamesTheFirstByteThatIsNot) {
  const test::ScratchFolder scratch;
  const std::string good = "# \xc2\xb5m \xe2\x82\xac \xf0\x9f\x94\xad\n1,2\n";
  ASSERT_TRUE(ReadTextFile(scratch.Put("good", good)));
  for (const std::string bad : {"\xc0\x80", "\xed\xa0\x80", "\xf5\x80\x80\x80", "\xe2\x82", "\x80",
                                "\xf0\x80\x80\x80", "\xe0\x80\x80"}) {
    const auto text = ReadTextFile(scratch.Put("bad", "a\nb\n" + bad));
    ASSERT_FALSE(text);
    EXPECT_THAT(text.error().text, HasSubstr("bad:3: not a text file"));
  }
}

TEST(TextFile, WritesThroughALinkAndKeepsItsMode) {
  const test::ScratchFolder scratch;
  const std::string file = scratch.Put("real", "old");
  const std::string link = scratch / "link";
  ASSERT_EQ(symlink(file.c_str(), link.c_str()), 0);
  ASSERT_TRUE(WriteFileAtomically(link, "new"));
  EXPECT_EQ(test::Slurp(file), "new");
  EXPECT_EQ(scratch.List(), (std::vector<std::string>{"link", "real"}));
}

}  // namespace
}  // namespace focalfleet
