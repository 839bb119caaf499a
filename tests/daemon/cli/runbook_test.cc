// The runbook explains every alarm, and nothing that is no alarm.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <set>
#include <sstream>
#include <string>
#include <string_view>

#include "fleet/alarm_name.h"
#include "tests/daemon/cli/program.h"

namespace focalfleet {
namespace {

/// The headings of the third level below "## Alarms".
std::set<std::string> HeadingsOf(const std::string& page) {
  std::set<std::string> headings;
  std::istringstream lines(page);
  bool alarms = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("## ")) alarms = line == "## Alarms";
    if (alarms && line.starts_with("### ")) headings.insert(line.substr(4));
  }
  return headings;
}

/// The anchor that renderers of Markdown give a heading of one word.
std::string AnchorOf(std::string heading) {
  for (char& letter : heading) letter = static_cast<char>(std::tolower(letter));
  return heading;
}

TEST(Runbook, ExplainsEveryAlarmAndNothingElse) {
  const auto headings = HeadingsOf(test::Slurp(FOCALFLEET_SOURCE_DIR "/docs/runbook.md"));
  std::set<std::string> names;
  for (const AlarmKind& kind : AlarmKinds())
    if (kind.name != AlarmName::kUnnamed) names.insert(kind.text);
  EXPECT_EQ(headings, names);
  for (const std::string& heading : headings)
    EXPECT_EQ(RunbookOf(AlarmNameOf(heading)), "docs/runbook.md#" + AnchorOf(heading));
}

TEST(Runbook, AnswersTheSameQuestionsForEach) {
  const std::string page = test::Slurp(FOCALFLEET_SOURCE_DIR "/docs/runbook.md");
  for (const AlarmKind& kind : AlarmKinds()) {
    if (kind.name == AlarmName::kUnnamed) continue;
    const std::size_t begin = page.find("### " + std::string(kind.text) + "\n");
    const std::string section = page.substr(begin, page.find("\n### ", begin + 4) - begin);
    for (const char* question : {"\n- Lost: ", "\n- Look at: ", "\n- Do: ", "\n- Call: "})
      EXPECT_THAT(section, ::testing::HasSubstr(question)) << kind.text;
    EXPECT_THAT(section, ::testing::HasSubstr("(" + std::string(Name(kind.severity)) + "; "))
        << kind.text;
  }
}

// DDS carries names of at most 31 bytes.
TEST(AlarmNames, AreCamelCaseUniqueAndShort) {
  std::set<std::string_view> names;
  for (const AlarmKind& kind : AlarmKinds()) {
    const std::string_view name = kind.text;
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_LE(name.size(), 31u) << name;
    if (kind.name == AlarmName::kUnnamed) continue;
    EXPECT_TRUE(std::isupper(name.front()) != 0) << name;
    for (const char letter : name) EXPECT_TRUE(std::isalpha(letter) != 0) << name;
    EXPECT_EQ(AlarmNameOf(name), kind.name);
  }
  EXPECT_EQ(AlarmNameOf("busdown"), AlarmName::kUnnamed);
}

}  // namespace
}  // namespace focalfleet
