#include "daemon/usage/complaint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace focalfleet::usage {
namespace {

/// A small program: `apply FILE --wait`, `layout hex --out`, and the option --json of all.
struct Program {
  CLI::App app{"", "ship"};
  std::string file;
  bool flag = false;
  Program() {
    app.fallthrough();
    app.require_subcommand(1);
    app.add_flag("--json", flag);
    CLI::App* apply = app.add_subcommand("apply", "");
    apply->add_option("FILE", file)->required();
    apply->add_flag("--wait", flag);
    CLI::App* layout = app.add_subcommand("layout", "");
    layout->require_subcommand(1);
    layout->add_subcommand("hex", "")->add_option("--out", file)->required();
    app.add_subcommand("status", "");
  }
};

std::string ComplaintAbout(const std::string& line) {
  Program program;
  try {
    program.app.parse(line);
  } catch (const CLI::ParseError& error) {
    return Complaint(program.app, error);
  }
  return "";
}

TEST(Complaint, CountsLettersToChangeAddDropAndSwap) {
  EXPECT_EQ(Distance("", ""), 0u);
  EXPECT_EQ(Distance("", "abc"), 3u);
  EXPECT_EQ(Distance("status", "status"), 0u);
  EXPECT_EQ(Distance("stauts", "status"), 1u) << "two neighbours swapped";
  EXPECT_EQ(Distance("statuss", "status"), 1u) << "one dropped";
  EXPECT_EQ(Distance("statu", "status"), 1u) << "one added";
  EXPECT_EQ(Distance("ststus", "status"), 1u) << "one changed";
  EXPECT_EQ(Distance("kitten", "sitting"), 3u);
  for (const char* a : {"ab", "ca", "abc", "bca"})
    for (const char* b : {"ab", "ca", "abc", "bca"}) EXPECT_EQ(Distance(a, b), Distance(b, a));
}

TEST(Complaint, NamesTheNearestWordAndNoneThatIsFar) {
  const std::vector<std::string> words = {"apply", "status", "state", "stop"};
  EXPECT_EQ(Nearest("stauts", words), "status");
  EXPECT_EQ(Nearest("aply", words), "apply");
  EXPECT_EQ(Nearest("stpo", words), "stop");
  EXPECT_EQ(Nearest("app", words), "apply") << "the begin of one";
  EXPECT_EQ(Nearest("sta", words), "") << "the begin of two";
  EXPECT_EQ(Nearest("teleport", words), "");
  EXPECT_EQ(Nearest(std::string(100'000, 'a'), words), "");
}

TEST(Complaint, SuggestsACommand) {
  EXPECT_EQ(ComplaintAbout("stauts"), "there is no command 'stauts'; did you mean 'status'?");
  EXPECT_EQ(ComplaintAbout("layout hxe"),
            "there is no command 'layout hxe'; did you mean 'layout hex'?");
  EXPECT_EQ(ComplaintAbout("teleport --far"), "there is no command 'teleport'");
}

TEST(Complaint, SuggestsAnOptionOfTheCommandAndOfThoseAbove) {
  EXPECT_EQ(ComplaintAbout("apply f --wiat"),
            "there is no option '--wiat'; did you mean '--wait'?");
  EXPECT_EQ(ComplaintAbout("apply f --jsno"),
            "there is no option '--jsno'; did you mean '--json'?");
  EXPECT_EQ(ComplaintAbout("status --wait"), "there is no option '--wait'")
      << "another command's option";
  EXPECT_EQ(ComplaintAbout("layout hex --uot=f"),
            "there is no option '--uot'; did you mean '--out'?")
      << "not that --out is missing";
}

TEST(Complaint, LeavesOtherReasonsAsTheyAre) {
  EXPECT_EQ(ComplaintAbout("apply"), "FILE is required");
  EXPECT_EQ(ComplaintAbout("layout"), "ship layout: a command is required");
  EXPECT_THAT(ComplaintAbout("apply f -1.5"), ::testing::HasSubstr("-1.5"));
  EXPECT_EQ(ComplaintAbout("apply f"), "");
}

}  // namespace
}  // namespace focalfleet::usage
