#include "daemon/process/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "daemon/loop/event_log.h"
#include "tests/support/datagram_inbox.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::DatagramInbox;
using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::Not;

std::string TextOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Log, AnEventIsOneLineWhateverItsTextHolds) {
  const ScratchFolder scratch;
  ASSERT_TRUE(OpenLog({.file = scratch / "log"}, {}));
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

TEST(Log, GoesOnInANewFileAfterARename) {
  const ScratchFolder scratch;
  ASSERT_TRUE(OpenLog({.file = scratch / "log"}, {}));
  spdlog::info("before");
  ASSERT_EQ(std::rename((scratch / "log").c_str(), (scratch / "log.1").c_str()), 0);
  spdlog::info("still there");
  ReopenLog();
  spdlog::info("after");
  EXPECT_THAT(TextOf(scratch / "log.1"), HasSubstr("info still there\n"));
  EXPECT_THAT(TextOf(scratch / "log.1"), Not(HasSubstr("after")));
  EXPECT_THAT(TextOf(scratch / "log"), HasSubstr("info after\n"));
  ReopenLog();
  EXPECT_THAT(TextOf(scratch / "log"), HasSubstr("info after\n")) << "nothing is cut off";
}

TEST(Log, StaysInItsFileWhereANewOneCannotBeOpened) {
  const ScratchFolder scratch;
  ASSERT_TRUE(OpenLog({.file = scratch / "log"}, {}));
  ASSERT_EQ(std::rename((scratch / "log").c_str(), (scratch / "log.1").c_str()), 0);
  // A folder of that name cannot be opened as a file, not even by root.
  ASSERT_EQ(mkdir((scratch / "log").c_str(), 0700), 0);
  ReopenLog();
  spdlog::info("after");
  EXPECT_THAT(TextOf(scratch / "log.1"), HasSubstr("error log.file stays as it is"));
  EXPECT_THAT(TextOf(scratch / "log.1"), HasSubstr("info after\n"));
}

TEST(Log, EventsInTheJournalHaveFields) {
  const ScratchFolder scratch;
  const DatagramInbox journal(scratch / "journal");
  ASSERT_TRUE(OpenLog({}, {.takes_standard_error = true, .socket = scratch / "journal"}));
  LogRow(AlarmRow{.id = 7,
                  .severity = Severity::kError,
                  .unit = UnitId{4711},
                  .bus = BusId{3},
                  .text = "unit 4711 is hot\nMESSAGE=forged",
                  .name = AlarmName::kUnitFault});
  EXPECT_EQ(journal.Next(),
            std::string("MESSAGE=alarm 7 UnitFault: unit 4711 is hot\\nMESSAGE=forged\n"
                        "PRIORITY=3\nSYSLOG_IDENTIFIER=focalfleetd\nMESSAGE_ID=") +
                kAlarmMessageId + "\nALARM=UnitFault\nUNIT_ID=4711\nBUS=3\n");
  LogRow(ConfigurationRow{.id = 12});
  EXPECT_THAT(*journal.Next(), HasSubstr("\nCONFIGURATION=12\n"));
  LogLink({.bus = BusId{5}, .state = LinkState::kDown}, "can5", "gone");
  EXPECT_THAT(*journal.Next(), HasSubstr("PRIORITY=4\n"));
  spdlog::info("plain");
  EXPECT_EQ(journal.Next(), "MESSAGE=plain\nPRIORITY=6\nSYSLOG_IDENTIFIER=focalfleetd\n");
}

TEST(Log, GoesToStandardErrorWhereTheJournalIsNotWantedOrNotThere) {
  const ScratchFolder scratch;
  testing::internal::CaptureStderr();
  ASSERT_TRUE(OpenLog({}, {.takes_standard_error = true, .socket = scratch / "nobody"}));
  spdlog::info("the journal is gone");
  const DatagramInbox journal(scratch / "journal");
  ASSERT_TRUE(
      OpenLog({.journal = false}, {.takes_standard_error = true, .socket = scratch / "journal"}));
  spdlog::info("not wanted");
  ASSERT_TRUE(OpenLog({}, {.takes_standard_error = false, .socket = scratch / "journal"}));
  spdlog::info("no stream of the journal");
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_THAT(text, HasSubstr(" info the journal is gone\n"));
  EXPECT_THAT(text, HasSubstr(" info not wanted\n"));
  EXPECT_THAT(text, HasSubstr(" info no stream of the journal\n"));
  EXPECT_FALSE(journal.Next(0));
}

}  // namespace
}  // namespace focalfleet
