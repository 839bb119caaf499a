#include "daemon/ports/link_recovery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <system_error>
#include <utility>

namespace focalfleet {
namespace {

HostInstant At(std::int64_t ms) { return HostInstant{0} + Milliseconds(ms); }

TEST(LinkRecovery, WithoutAThreadItIsTriedLater) {
  bool none_left = true;
  int revived = 0;
  LinkRecovery recovery({.revive = [&revived]() -> Status {
                           ++revived;
                           return {};
                         },
                         .start =
                             [&none_left](std::function<void()> work) {
                               if (none_left)
                                 throw std::system_error(EAGAIN, std::generic_category());
                               return std::thread(std::move(work));
                             }});
  recovery.BusOff(At(0));
  const auto refused = recovery.Poll(At(1000));
  ASSERT_TRUE(refused);
  ASSERT_FALSE(*refused);
  EXPECT_EQ(refused->error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused->error().text, ::testing::HasSubstr("no thread"));
  EXPECT_FALSE(recovery.trying());
  EXPECT_GT(recovery.wake_at(), At(1000)) << "the wait grows as after any other failure";
  none_left = false;
  std::optional<Status> outcome;
  for (std::int64_t ms = 3000; !outcome; ms += 10) outcome = recovery.Poll(At(ms));
  EXPECT_TRUE(*outcome);
  EXPECT_EQ(revived, 1);
}

}  // namespace
}  // namespace focalfleet
