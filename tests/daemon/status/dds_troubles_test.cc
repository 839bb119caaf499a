#include "daemon/status/dds_troubles.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(DdsTroubles, EachReportWakesAndIsTakenOnce) {
  int woken = 0;
  DdsTroubles troubles([&] { ++woken; });
  troubles.Report(AlarmName::kDdsMissing, "status", "no domain");
  troubles.Report(AlarmName::kCameraDdsMissing, "the camera", "no topic");
  EXPECT_EQ(woken, 2);
  EXPECT_EQ(troubles.Summary(), "status: no domain; the camera: no topic");
  const auto notes = troubles.TakeNotes();
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[0].name, AlarmName::kDdsMissing);
  EXPECT_EQ(notes[1].name, AlarmName::kCameraDdsMissing);
  EXPECT_TRUE(troubles.TakeNotes().empty());
}

TEST(DdsTroubles, ATroubleThatEndedIsNotInTheSummary) {
  DdsTroubles troubles([] {});
  troubles.Report(AlarmName::kDdsMissing, "status", "no domain");
  troubles.Report(AlarmName::kDdsMissing, "status", "");
  EXPECT_EQ(troubles.Summary(), "");
  const ShellNote back = troubles.TakeNotes().back();
  EXPECT_EQ(back.name, AlarmName::kDdsBack);
  EXPECT_EQ(back.ends, AlarmName::kDdsMissing);
}

TEST(DdsTroubles, CountsTroublesAndPassesOnNotesOfOthers) {
  int woken = 0;
  DdsTroubles troubles([&] { ++woken; });
  troubles.Note({AlarmName::kMetricsMissing, "a port is in use"});
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(troubles.reported(), 0u) << "no trouble of DDS";
  EXPECT_EQ(troubles.Summary(), "");
  ASSERT_EQ(troubles.TakeNotes().size(), 1u);
  troubles.Report(AlarmName::kDdsMissing, "status", "no domain");
  troubles.Report(AlarmName::kDdsMissing, "status", "");
  troubles.Report(AlarmName::kDdsMissing, "status", "no domain");
  EXPECT_EQ(troubles.reported(), 2u);
}

}  // namespace
}  // namespace focalfleet
