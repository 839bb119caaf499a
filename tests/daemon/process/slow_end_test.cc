#include "daemon/process/slow_end.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>

#include "tests/support/datagram_inbox.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::DatagramInbox;
using test::ScratchFolder;
using ::testing::HasSubstr;

TEST(SlowEnd, AsksForTimeAsLongAsItProceeds) {
  const ScratchFolder scratch;
  const DatagramInbox manager(scratch / "notify");
  const NotifySocket socket = NotifySocket::FromEnvironment(
      [path = scratch / "notify"](const char*) { return path.c_str(); });
  std::atomic<std::uint64_t> batches = 5;
  std::atomic<int> looks = 0;
  {
    const SlowEnd end(&socket, {.progress =
                                    [&] {
                                      ++looks;
                                      return batches.load();
                                    },
                                .period = std::chrono::milliseconds(1),
                                .more = std::chrono::milliseconds(10'000)});
    while (looks < 20) std::this_thread::yield();
    EXPECT_FALSE(manager.Next(0)) << "an end that hangs asks for nothing";
    batches = 6;
    const auto asked = manager.Next();
    ASSERT_TRUE(asked);
    EXPECT_THAT(*asked, HasSubstr("EXTEND_TIMEOUT_USEC=10000000\n"));
    EXPECT_THAT(*asked, HasSubstr("STATUS=ending: "));
    EXPECT_THAT(*asked, HasSubstr("batch 6"));
  }
  EXPECT_FALSE(manager.Next(0));
}

}  // namespace
}  // namespace focalfleet
