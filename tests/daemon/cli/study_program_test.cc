// The study commands are a program of their own: focalfleet names them, runs that program, and says
// so where it is not installed.
#include "daemon/cli/study_program.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "daemon/study/study.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

namespace fs = std::filesystem;
using test::RunProgram;
using test::ScratchFolder;

/// Commands with their descriptions.
std::map<std::string, std::string> CommandsOf(cli::AddStudy add_study) {
  std::map<std::string, std::string> commands;
  const auto line = cli::MakeCommandLine(add_study);
  for (const CLI::App* command : line->app.get_subcommands({}))
    commands[command->get_name()] = command->get_group() + ": " + command->get_description();
  return commands;
}

TEST(StudyProgram, BothProgramsNameTheSameCommands) {
  EXPECT_EQ(CommandsOf(cli::AddStudyNames), CommandsOf(cli::AddStudyCommands));
}

TEST(StudyProgram, TheCommandIsTheFirstWordThatIsNoOption) {
  const auto word = [](std::vector<const char*> arguments) {
    arguments.insert(arguments.begin(), "focalfleet");
    return cli::CommandWord(static_cast<int>(arguments.size()), arguments.data());
  };
  EXPECT_EQ(word({}), "");
  EXPECT_EQ(word({"--json"}), "");
  EXPECT_EQ(word({"diagnose", "hall"}), "diagnose");
  EXPECT_EQ(word({"--json", "--socket", "diagnose", "status"}), "status");
  EXPECT_EQ(word({"--socket=diagnose", "hall", "--help"}), "hall");
  EXPECT_EQ(word({"--timeout", "1", "--color", "never", "-q", "tune"}), "tune");
}

// focalfleet in a folder of its own, where focalfleet-study is not.
class Alone : public ::testing::Test {
 protected:
  Alone() : program_(folder_ / "bin/focalfleet") {
    fs::create_directory(folder_ / "bin");
    fs::copy_file(FOCALFLEET_PROGRAM, program_);
  }
  ScratchFolder folder_;
  fs::path program_;
};

TEST_F(Alone, StudyCommandsSayWhatIsMissing) {
  const auto result = RunProgram({program_, "diagnose", "night", "--out", "report"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_NE(result.err.find("diagnose is a command of the program focalfleet-study, which is not "
                            "installed"),
            std::string::npos)
      << result.err;
}

TEST_F(Alone, EverythingElseWorks) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"help", "layout"}, {"completion", "bash"}, {"--help"}}) {
    std::vector<std::string> line = {program_};
    line.insert(line.end(), arguments.begin(), arguments.end());
    const auto result = RunProgram(line);
    EXPECT_EQ(result.exit, 0) << arguments.front() << result.err;
    EXPECT_NE(result.out, "");
  }
  EXPECT_NE(RunProgram({program_, "--help"}).out.find("diagnose"), std::string::npos);
}

TEST_F(Alone, TheProgramIsAlsoFoundInLibexec) {
  fs::create_directories(folder_ / "libexec/focalfleet");
  fs::create_symlink(fs::path(FOCALFLEET_PROGRAM).parent_path() / "focalfleet-study",
                     folder_ / "libexec/focalfleet/focalfleet-study");
  const auto result = RunProgram({program_, "diagnose", "--help"});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_NE(result.out.find("--patch"), std::string::npos);
}

}  // namespace
}  // namespace focalfleet
