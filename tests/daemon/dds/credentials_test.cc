#include "daemon/dds/credentials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kEndS = 1'800'000'000;
constexpr std::int64_t kDayS = 86'400;

std::optional<ShellNote> Look(CredentialClock* clock, std::int64_t before_end_s,
                              std::int64_t end_s = kEndS) {
  return clock->Look({{"certificate.pem", end_s}, {"permissions.p7s", end_s + 5}},
                     WallTime{(kEndS - before_end_s) * 1'000'000'000});
}

TEST(CredentialClock, WarnsFourTimesAndOnceEach) {
  CredentialClock clock;
  EXPECT_FALSE(Look(&clock, 15 * kDayS));
  const std::pair<std::int64_t, const char*> warnings[] = {
      {14 * kDayS, "ends in 14 days"}, {kDayS, "ends in 24 hours"}, {3600, "ends in 60 minutes"}};
  for (const auto& [before_s, text] : warnings) {
    const auto note = Look(&clock, before_s);
    ASSERT_TRUE(note) << text;
    EXPECT_EQ(note->name, AlarmName::kDdsCredentialsEnding);
    EXPECT_THAT(note->text, HasSubstr(text));
    EXPECT_THAT(note->text, HasSubstr("certificate.pem"));
    EXPECT_FALSE(Look(&clock, before_s - 10)) << "said already";
  }
  const auto ended = Look(&clock, 0);
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->name, AlarmName::kDdsCredentialsEnded);
  EXPECT_EQ(ended->ends, AlarmName::kDdsCredentialsEnding);
  EXPECT_FALSE(Look(&clock, -kDayS));
}

TEST(CredentialClock, AStartShortlyBeforeTheEndWarnsAtOnce) {
  CredentialClock clock;
  EXPECT_EQ(Look(&clock, 60)->name, AlarmName::kDdsCredentialsEnding);
  CredentialClock late;
  EXPECT_EQ(Look(&late, -60)->name, AlarmName::kDdsCredentialsEnded);
}

TEST(CredentialClock, RenewedCredentialsEndTheAlarm) {
  CredentialClock clock;
  ASSERT_TRUE(Look(&clock, kDayS));
  const auto renewed = Look(&clock, kDayS, kEndS + 365 * kDayS);
  ASSERT_TRUE(renewed);
  EXPECT_EQ(renewed->name, AlarmName::kDdsCredentialsRenewed);
  EXPECT_EQ(renewed->ends, AlarmName::kDdsCredentialsEnding);
  ASSERT_TRUE(Look(&clock, -10));
  EXPECT_EQ(Look(&clock, -10, kEndS + 365 * kDayS)->ends, AlarmName::kDdsCredentialsEnded);
}

TEST(Credentials, TheSoonestEndOfPermissionsCounts) {
  EXPECT_EQ(EndOfPermissions("<not_after>2030-01-01T00:00:00</not_after>"
                             "<not_after>2027-01-15T08:00:00Z</not_after>"),
            1'800'000'000);
  for (const char* text : {"", "<not_after></not_after>", "<not_after>soon</not_after>",
                           "<not_after>", "<not_after>2030-01-01"})
    EXPECT_FALSE(EndOfPermissions(text)) << text;
}

}  // namespace
}  // namespace focalfleet
