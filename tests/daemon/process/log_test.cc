#include "daemon/process/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <fstream>
#include <string>
#include <vector>

#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

TEST(Log, AnEventIsOneLineWhateverItsTextHolds) {
  const ScratchFolder scratch;
  ASSERT_TRUE(OpenLog({.file = scratch / "log"}));
  spdlog::info("{}", "stop refused: \n2024-01-01T00:00:00.000+0000 info apply commanded\x1b[2J");
  spdlog::info("next");
  std::ifstream file(scratch / "log");
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_THAT(lines[0], HasSubstr("info stop refused: \\n2024-01-01"));
  EXPECT_THAT(lines[0], HasSubstr("commanded\\x1b[2J"));
  EXPECT_THAT(lines[1], HasSubstr("info next"));
}

}  // namespace
}  // namespace focalfleet
