#include "daemon/status/dds_troubles.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(DdsTroubles, EachReportWakesAndIsTakenOnce) {
  int woken = 0;
  DdsTroubles troubles([&] { ++woken; });
  troubles.Report("status", "no domain");
  troubles.Report("the camera", "no topic");
  EXPECT_EQ(woken, 2);
  EXPECT_EQ(troubles.Summary(), "status: no domain; the camera: no topic");
  const auto notes = troubles.TakeNotes();
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[0].severity, Severity::kError);
  EXPECT_TRUE(troubles.TakeNotes().empty());
}

TEST(DdsTroubles, ATroubleThatEndedIsNotInTheSummary) {
  DdsTroubles troubles([] {});
  troubles.Report("status", "no domain");
  troubles.Report("status", "");
  EXPECT_EQ(troubles.Summary(), "");
  EXPECT_EQ(troubles.TakeNotes().back().severity, Severity::kInfo);
}

TEST(DdsTroubles, CountsTroublesAndPassesOnNotesOfOthers) {
  int woken = 0;
  DdsTroubles troubles([&] { ++woken; });
  troubles.Note({Severity::kWarning, "a port is in use"});
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(troubles.reported(), 0u) << "no trouble of DDS";
  EXPECT_EQ(troubles.Summary(), "");
  ASSERT_EQ(troubles.TakeNotes().size(), 1u);
  troubles.Report("status", "no domain");
  troubles.Report("status", "");
  troubles.Report("status", "no domain");
  EXPECT_EQ(troubles.reported(), 2u);
}

}  // namespace
}  // namespace focalfleet
