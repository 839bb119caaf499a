#include "daemon/journal/replay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/journal/step_record.h"
#include "fleet/hex_layout.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::journal {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

/// A coordinator that nobody answers, and the records of its first steps.
class Silence {
 public:
  Silence()
      : layout_(*Layout::Create(MakeHexLayout({.count = 7}), {})),
        drives_(layout_.size()),
        coordinator_(&layout_, drives_, {}, {}) {}

  /// `alter` may change the effects before they are recorded.
  void Step(const std::function<void(Effects*)>& alter = [](Effects*) {}) {
    Effects effects;
    now_ = now_ + Milliseconds(500);
    const Inputs inputs{.now = now_, .frames = {}, .links = {}, .commands = {}, .plans = {}};
    coordinator_.Step(inputs, &effects);
    alter(&effects);
    records_.push_back({records_.size() + 1, RecordOf(inputs, effects)});
  }
  void Write(const std::string& folder) const {
    auto writer = JournalWriter::Open({.folder = folder, .limit_bytes = 1 << 30},
                                      LifeOf(layout_, drives_, {}, {}));
    ASSERT_TRUE(writer) << writer.error().text;
    ASSERT_TRUE((*writer)->Write(records_));
    ASSERT_TRUE((*writer)->End());
  }

 private:
  Layout layout_;
  std::vector<UnitDrive> drives_;
  Coordinator coordinator_;
  HostInstant now_{0};
  std::vector<NumberedRecord> records_;
};

TEST(Replay, FindsEachStepDecidedTheSame) {
  const ScratchFolder scratch;
  Silence silence;
  for (int step = 0; step < 20; ++step) silence.Step();
  silence.Write(scratch / "j");
  const auto report = ReplayJournal(scratch / "j", "1", [](std::uint64_t) {});
  ASSERT_TRUE(report) << report.error().text;
  EXPECT_EQ(report->steps, 20u);
  EXPECT_EQ(report->units, 7u);
  EXPECT_EQ(report->end, JournalReader::End::kWhole);
  EXPECT_NEAR(report->host_s, 19 * 0.5, 1e-9);
}

TEST(Replay, NamesTheStepThatDecidesOtherwiseAndWhatDiffers) {
  const std::pair<std::string, std::function<void(Effects*)>> cases[] = {
      {"other frames", [](Effects* effects) { effects->frames.push_back({}); }},
      {"other rows", [](Effects* effects) { ++effects->batch; }},
      {"other replies", [](Effects* effects) { effects->replies.push_back({.request = 9}); }},
      {"other times and changes", [](Effects* effects) { ++effects->wake_at.ns; }},
      {"other jobs", [](Effects* effects) { effects->exposure.emplace(); }}};
  for (const auto& [what, alter] : cases) {
    const ScratchFolder scratch;
    Silence silence;
    for (int step = 0; step < 5; ++step) silence.Step();
    silence.Step(alter);
    silence.Write(scratch / "j");
    const auto report = ReplayJournal(scratch / "j", "1", [](std::uint64_t) {});
    ASSERT_FALSE(report) << what;
    EXPECT_EQ(report.error().code, ErrorCode::kRefused);
    EXPECT_THAT(report.error().text, HasSubstr("step 6 at 3.000000 s decides " + what));
    EXPECT_THAT(report.error().text, HasSubstr("this program is 1"));
  }
}

}  // namespace
}  // namespace focalfleet::journal
