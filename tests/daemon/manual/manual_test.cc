// The man pages as `man` shows them: no warning, and every command, option and key is there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>

#include "daemon/cli/command_line.h"
#include "daemon/cli/completion.h"
#include "daemon/process/config_manual.h"
#include "daemon/simulator/command_line.h"
#include "daemon/study/study.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::IsEmpty;

namespace fs = std::filesystem;

// A page is long: a matcher would print all of it.
bool Has(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

class ManualPages : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::ScratchFolder;
    const auto written = test::RunProgram(
        {FOCALFLEET_MANUAL, *folder_ / "man", FOCALFLEET_SOURCE_DIR "/deploy/man"});
    ASSERT_EQ(written.exit, 0) << written.err;
    for (const auto& entry : fs::directory_iterator(*folder_ / "man")) {
      const auto shown =
          test::RunProgram({"man", "--warnings", "-E", "UTF-8", "-l", entry.path().string()},
                           {{"MANWIDTH", "1000"}, {"LC_ALL", "C.UTF-8"}});
      EXPECT_EQ(shown.exit, 0) << entry.path();
      warnings_ += shown.err;
      pages_[entry.path().filename().string()] = shown.out;
    }
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string Page(const std::string& file) {
    EXPECT_TRUE(pages_.contains(file)) << file;
    return pages_[file];
  }

  static inline test::ScratchFolder* folder_ = nullptr;
  static inline std::map<std::string, std::string> pages_;
  static inline std::string warnings_;
};

TEST_F(ManualPages, AreShownWithoutAWarning) {
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_GT(pages_.size(), 30u);
  for (const auto& [file, text] : pages_) {
    for (const char* section : {"\nNAME\n", "\nDESCRIPTION\n", "\nSEE ALSO\n"})
      EXPECT_TRUE(Has(text, section)) << file;
  }
}

TEST_F(ManualPages, HaveEveryCommandAndOptionOfTheCommandLine) {
  const auto nodes = cli::WalkCommands(cli::MakeCommandLine(cli::AddStudyCommands)->app);
  const std::string program = Page("focalfleet.1");
  std::set<std::string> of_all;
  for (const auto& option : nodes.front().options) {
    for (const std::string& name : option.names) {
      of_all.insert(name);
      EXPECT_TRUE(Has(program, name)) << name;
    }
  }
  for (const cli::CompletionNode& node : nodes) {
    if (node.path.empty()) continue;
    const std::string command = node.path.substr(0, node.path.find(' '));
    EXPECT_TRUE(Has(program, "focalfleet-" + command + "(1)"));
    const std::string page = Page("focalfleet-" + command + ".1");
    EXPECT_TRUE(Has(page, "focalfleet " + node.path));
    for (const char* section : {"\nSYNOPSIS\n", "\nEXIT STATUS\n"})
      EXPECT_TRUE(Has(page, section)) << node.path;
    for (const auto& option : node.options) {
      if (!of_all.contains(option.names.front())) {
        EXPECT_TRUE(Has(page, option.names.front())) << node.path;
      }
    }
  }
}

TEST_F(ManualPages, HaveAnExampleOfEveryCommand) {
  for (const auto& node : cli::WalkCommands(cli::MakeCommandLine(cli::AddStudyCommands)->app)) {
    if (!node.commands.empty()) continue;
    const std::string page = Page("focalfleet-" + node.path.substr(0, node.path.find(' ')) + ".1");
    const std::string lines = "focalfleet " + node.path;
    std::size_t times = 0;
    for (std::size_t at = page.find(lines); at != std::string::npos; at = page.find(lines, at + 1))
      ++times;
    EXPECT_GE(times, node.path == "help" ? 1u : 2u) << node.path << ": synopsis and example";
  }
}

TEST_F(ManualPages, HaveEveryCommandOfTheSimulation) {
  const std::string page = Page("focalfleet-sim.1");
  for (const char* text : {"truth", "power-cut", "misbehave", "--unix-directory", "--late NUMBER",
                           "NUMBER from 0 to 86400", "nobody answers at the control socket"})
    EXPECT_TRUE(Has(page, text));
  EXPECT_TRUE(Has(Page("focalfleetd.8"), "--check"));
}

TEST_F(ManualPages, HaveEveryKeyOfTheConfigurationWithItsDefault) {
  const std::string page = Page("focalfleet.toml.5");
  std::size_t keys = 0;
  for (const ConfigSection& section : DescribeConfig()) {
    const std::size_t begin = page.find("\n[" + section.name + "]\n");
    ASSERT_NE(begin, std::string::npos) << section.name;
    for (const ConfigKey& key : section.keys) {
      const std::string name = key.name.substr(section.name.size() + 1);
      EXPECT_NE(page.find("       " + name, begin), std::string::npos) << key.name;
      EXPECT_NE(page.find("default " + key.initial, begin), std::string::npos) << key.name;
      ++keys;
    }
  }
  EXPECT_GT(keys, 40u);
}

TEST_F(ManualPages, HaveEveryFunctionOfTheProtocol) {
  const std::string page = Page("focalfleet-protocol.7");
  const std::string wire = test::Slurp(FOCALFLEET_SOURCE_DIR "/docs/protocol.md");
  std::istringstream lines(wire.substr(wire.find("| function | prio |")));
  std::string line;
  std::size_t functions = 0;
  while (std::getline(lines, line) && line.starts_with("|")) {
    const std::string name = line.substr(2, line.find(" |", 2) - 2);
    if (name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) == 0) continue;
    EXPECT_TRUE(Has(page, "\n       " + name)) << name;
    ++functions;
  }
  EXPECT_EQ(functions, 17u);
}

}  // namespace
}  // namespace focalfleet
