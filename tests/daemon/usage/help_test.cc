#include "daemon/usage/help.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace focalfleet::usage {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Help, HasDescriptionUsageOptionsExamplesAndManual) {
  CLI::App app("A ship", "ship");
  app.formatter(std::make_shared<HelpFormatter>(HelpClosing{
      .of_commands = "Every command floats.", .manual = "ship", .page_a_command = true}));
  app.set_help_flag("-h,--help", "Show this help");
  int knots = 3;
  CLI::App* sail = app.add_subcommand("sail", "Go with the wind");
  sail->footer("  ship sail --knots 5");
  sail->add_option("--knots", knots, "How fast")->check(CLI::Range(1, 9))->capture_default_str();
  app.footer("Exit codes:\n  0  afloat");
  EXPECT_EQ(sail->help(),
            "Go with the wind\n"
            "\n"
            "Usage: ship sail [OPTIONS]\n"
            "\n"
            "Options:\n"
            "  -h, --help                Show this help\n"
            "  --knots N                 How fast (N from 1 to 9; default 3)\n"
            "\n"
            "Examples:\n"
            "  ship sail --knots 5\n"
            "\n"
            "Every command floats.\n"
            "Manual: man ship-sail\n");
  EXPECT_THAT(app.help(), HasSubstr("\nCommands:\n  sail                      Go with the wind\n"));
  EXPECT_THAT(app.help(), HasSubstr("\nExit codes:\n  0  afloat\n\nManual: man ship\n"));
  EXPECT_THAT(app.help(), Not(HasSubstr("Every command floats")));
}

TEST(Help, ShowsGroupsInTheOrderOfTheirFirstCommand) {
  CLI::App app("", "ship");
  for (const auto& [name, group] : {std::pair{"sail", "Go"}, {"moor", "Rest"}, {"row", "Go"}})
    app.add_subcommand(name, "it")->group(group);
  EXPECT_EQ(ShortHelp(app),
            "Usage: ship [OPTIONS] [COMMAND]\n"
            "\n"
            "Go:\n"
            "  sail                      it\n"
            "  row                       it\n"
            "\n"
            "Rest:\n"
            "  moor                      it\n"
            "\n"
            "`ship --help` shows the options.\n");
}

TEST(Help, WrapsBetweenWords) {
  EXPECT_EQ(Wrapped("one two three", 2, 9), "one two\n  three");
  EXPECT_EQ(Wrapped("indivisible", 2, 6), "indivisible");
  EXPECT_EQ(Wrapped("", 2, 6), "");
}

}  // namespace
}  // namespace focalfleet::usage
