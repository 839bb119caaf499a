#include "daemon/systemd/journal_socket.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "tests/support/datagram_inbox.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::DatagramInbox;
using test::ScratchFolder;

TEST(JournalSocket, AFieldIsALine) {
  const ScratchFolder scratch;
  const DatagramInbox journal(scratch / "journal");
  const JournalSocket socket(scratch / "journal");
  EXPECT_TRUE(socket.Send(std::vector<JournalField>{{"MESSAGE", "bus 3 is down"}, {"BUS", "3"}}));
  EXPECT_EQ(journal.Next(), "MESSAGE=bus 3 is down\nBUS=3\n");
}

// The expected bytes are those of the example in the protocol's description: name, newline, length
// in 8 bytes with the least first, value, newline.
TEST(JournalSocket, AValueOfSeveralLinesStandsBehindItsLength) {
  const ScratchFolder scratch;
  const DatagramInbox journal(scratch / "journal");
  const JournalSocket socket(scratch / "journal");
  EXPECT_TRUE(socket.Send(std::vector<JournalField>{{"MESSAGE", "foo\nbar"}}));
  EXPECT_EQ(journal.Next(), std::string("MESSAGE\n\x07\0\0\0\0\0\0\0foo\nbar\n", 24));
}

TEST(JournalSocket, ALongValueIsCut) {
  const ScratchFolder scratch;
  const DatagramInbox journal(scratch / "journal");
  const JournalSocket socket(scratch / "journal");
  const std::string long_text(1'000'000, 'x');
  EXPECT_TRUE(socket.Send(std::vector<JournalField>{{"MESSAGE", long_text}}));
  EXPECT_EQ(journal.Next()->size(), JournalSocket::kValueBytesMax + 9);
}

TEST(JournalSocket, SaysWhereTheJournalDoesNotRun) {
  const ScratchFolder scratch;
  const JournalSocket socket(scratch / "journal");
  EXPECT_FALSE(socket.Send(std::vector<JournalField>{{"MESSAGE", "lost"}}));
}

TEST(StandardErrorIsJournal, AsDeviceAndInodeSay) {
  struct stat status {};
  ASSERT_EQ(fstat(STDERR_FILENO, &status), 0);
  const std::string own = std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
  const std::string other = std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino + 1);
  EXPECT_TRUE(StandardErrorIsJournal([&](const char*) { return own.c_str(); }));
  EXPECT_FALSE(StandardErrorIsJournal([&](const char*) { return other.c_str(); }));
  EXPECT_FALSE(StandardErrorIsJournal([](const char*) { return "8:"; }));
  EXPECT_FALSE(StandardErrorIsJournal([](const char*) -> const char* { return nullptr; }));
}

}  // namespace
}  // namespace focalfleet
