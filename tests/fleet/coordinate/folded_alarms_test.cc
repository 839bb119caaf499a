#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

#include "fleet/coordinate/ledger.h"
#include "fleet/layout.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// A ledger without units, step by step.
class Steps {
 public:
  Steps() : ledger_(layout_, config_, {}, step_) {}

  /// A step at `at` in which the bus flaps `flaps` times and ends well, or not.
  void Step(DurationNs at, int flaps, bool ends_well = true) {
    effects_.Clear();
    step_ = {HostInstant{0} + at, &effects_};
    ledger_.BeginStep(0, false);
    for (int k = 0; k < flaps; ++k) {
      ledger_.alarms().Raise(AlarmName::kBusPassive, {}, BusId{3}, "bus 3 is passive");
      if (k + 1 < flaps || ends_well) ledger_.alarms().End(AlarmName::kBusPassive, {}, BusId{3});
    }
    Take();
  }
  /// The last step before the end.
  void End(DurationNs at) {
    effects_.Clear();
    step_ = {HostInstant{0} + at, &effects_};
    ledger_.alarms().NoteAllFolded();
    Take();
  }
  Ledger* ledger() { return &ledger_; }

  std::vector<AlarmRow> alarms;
  std::size_t ends = 0;

 private:
  void Take() {
    for (const Row& row : effects_.rows) {
      if (const auto* alarm = std::get_if<AlarmRow>(&row)) alarms.push_back(*alarm);
      if (std::holds_alternative<AlarmEndRow>(row)) ++ends;
    }
  }

  Layout layout_;
  CoordinatorConfig config_;
  Effects effects_;
  StepState step_{{}, &effects_};
  Ledger ledger_;
};

TEST(Ledger, EqualAlarmsInQuickSuccessionAreFolded) {
  Steps steps;
  for (int ms = 0; ms < 60'000; ms += 100) steps.Step(Milliseconds(ms), 10);
  EXPECT_EQ(steps.alarms.size(), 3u);
  steps.Step(Seconds(60), 0);
  ASSERT_EQ(steps.alarms.size(), 4u);
  EXPECT_EQ(steps.alarms.back().times, 6000u - 3);
  EXPECT_THAT(steps.alarms.back().text, HasSubstr("bus 3 is passive (5997 times more in 60 s)"));
  EXPECT_EQ(steps.alarms.back().bus, BusId{3});
}

TEST(Ledger, AFaultThatGoesOnIsOneLineAWindow) {
  Steps steps;
  for (int s = 0; s < 3600; ++s) steps.Step(Seconds(s), 1);
  EXPECT_LE(steps.alarms.size(), 3u + 60);
  EXPECT_GE(steps.alarms.size(), 50u);
  steps.End(Seconds(3600));
  std::uint32_t times = 0;
  for (const AlarmRow& alarm : steps.alarms) times += alarm.times;
  EXPECT_EQ(times, 3600u) << "none is lost";
}

TEST(Ledger, AConditionThatLastsIsNotedSoonThoughItWasFolded) {
  Steps steps;
  steps.Step(Seconds(1), 50, /*ends_well=*/false);
  EXPECT_EQ(steps.alarms.size(), 3u);
  steps.Step(Seconds(3), 0);
  ASSERT_EQ(steps.alarms.size(), 4u);
  EXPECT_EQ(steps.alarms.back().times, 47u);
}

TEST(Ledger, AConditionThatIsReportedAgainWhileItLastsIsNotedSoon) {
  Steps steps;
  steps.Step(Seconds(1), 5);
  for (int s = 2; s < 5; ++s) steps.Step(Seconds(s), 1, /*ends_well=*/false);
  ASSERT_EQ(steps.alarms.size(), 4u);
  EXPECT_THAT(steps.alarms.back().text, HasSubstr("(4 times more in 3 s, the last 1 s ago)"));
}

TEST(Ledger, FoldedAlarmsAreNotedAtTheEnd) {
  Steps steps;
  steps.Step(Seconds(1), 50);
  steps.End(Seconds(21));
  ASSERT_EQ(steps.alarms.size(), 4u);
  EXPECT_THAT(steps.alarms.back().text,
              HasSubstr("bus 3 is passive (47 times more in 20 s, the last 20 s ago)"));
  steps.End(Seconds(22));
  EXPECT_EQ(steps.alarms.size(), 4u) << "each once";
}

TEST(Ledger, DifferentAlarmsOfOneKindAreNotCalledTheSame) {
  Steps steps;
  for (int k = 0; k < 9; ++k)
    steps.ledger()->alarms().Raise(AlarmName::kRowRefused, {}, {}, "row " + std::to_string(k));
  steps.End(Seconds(0));
  ASSERT_EQ(steps.alarms.size(), 1u);
  EXPECT_EQ(steps.alarms.back().text, "row 8 (6 of its kind in 0 s)");
}

TEST(Ledger, AnEndedConditionThatWasFoldedStaysEnded) {
  Steps steps;
  steps.Step(Seconds(1), 50);
  const std::size_t ends = steps.ends;
  steps.Step(Seconds(62), 0);
  EXPECT_EQ(steps.alarms.size(), 4u);
  EXPECT_EQ(steps.ends, ends + 1);
}

TEST(Ledger, AlarmsFarApartAreNotFolded) {
  Steps steps;
  for (int minute = 0; minute < 10; ++minute) steps.Step(Seconds(61 * minute), 1);
  EXPECT_EQ(steps.alarms.size(), 10u);
  for (const AlarmRow& alarm : steps.alarms) EXPECT_EQ(alarm.times, 1u);
}

}  // namespace
}  // namespace focalfleet
