// These tests compare the coordinator's knowledge of when units begin, by their own clocks, with
// the truth.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/plan/planner.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::InProcessFleet;
using test::TestSeed;
using ::testing::HasSubstr;

const double kAllowed_s = 2 * PlanOptions{}.start_skew_s;
/// Time between two looks at a state: one turn of the loop before, one after.
constexpr double kLook_s = 0.0004;

struct TrueStarts {
  HostInstant first = kNever;
  HostInstant last{INT64_MIN};
  std::uint32_t count = 0;
  [[nodiscard]] double skew_s() const { return (last - first).seconds(); }
};

bool IsAboutToStart(InProcessFleet* fleet, std::uint64_t configuration, DurationNs before) {
  return fleet->RunUntil(
      [&] {
        const ConfigurationView& view = fleet->coordinator().configuration();
        return view.id == configuration && view.started != kNever &&
               fleet->now() >= view.started - before;
      },
      Seconds(120));
}

/// Watches every unit's state from now on; returns when each began.
TrueStarts WatchStarts(InProcessFleet* fleet, DurationNs duration = Milliseconds(300)) {
  TrueStarts starts;
  std::vector<bool> seen(fleet->layout().size());
  fleet->RunUntil(
      [&] {
        for (std::size_t n = 0; n < seen.size(); ++n) {
          if (seen[n] || fleet->world().Truth(n).state != UnitState::kMoving) continue;
          seen[n] = true;
          ++starts.count;
          starts.first = std::min(starts.first, fleet->now());
          starts.last = std::max(starts.last, fleet->now());
        }
        return false;
      },
      duration);
  return starts;
}

std::uint64_t NextConfiguration(InProcessFleet* fleet) {
  return fleet->coordinator().configuration().id + 1;
}

std::vector<AlarmRow> Troubles(InProcessFleet& fleet) {
  std::vector<AlarmRow> troubles;
  for (const AlarmRow& alarm : fleet.store().alarms)
    if (alarm.severity != Severity::kInfo) troubles.push_back(alarm);
  return troubles;
}

TEST(StartSkew, IsMeasuredAsItIs) {
  for (std::uint64_t k = 0; k < 6; ++k) {
    const std::uint64_t seed = TestSeed(21) + k;
    SCOPED_TRACE(seed);
    InProcessFleet fleet(
        {.count = 91, .units_per_bus = 20, .seed = seed, .clock_error_max = 0.0045});
    fleet.Run(Milliseconds(1500 + 4000 * static_cast<std::int64_t>(k)));
    const std::uint64_t configuration = NextConfiguration(&fleet);
    fleet.ApplyRandom(seed);
    ASSERT_TRUE(IsAboutToStart(&fleet, configuration, Milliseconds(60)));
    const TrueStarts truth = WatchStarts(&fleet);
    ASSERT_TRUE(fleet.RunUntilIdle());
    const StartView& said = fleet.coordinator().configuration().starts;
    EXPECT_EQ(said.round, 1u);
    EXPECT_EQ(said.reported, said.begun);
    EXPECT_EQ(said.reported, truth.count);
    EXPECT_NEAR(said.skew_s, truth.skew_s(), said.bound_s + kLook_s);
    EXPECT_LE(said.least_s, said.skew_s);
    EXPECT_LE(said.skew_s, said.most_s);
    EXPECT_LE(said.least_s, truth.skew_s() + kLook_s);
    EXPECT_GE(said.most_s, truth.skew_s() - kLook_s);
    EXPECT_LE(said.most_s, said.allowed_s);
    EXPECT_EQ(said.allowed_s, kAllowed_s);
    // The clocks count a quarter of a second down, and are off by half a percent at most.
    EXPECT_LE(truth.skew_s(), 0.004);
    fleet.Run(Milliseconds(50));  // its last row is written
    EXPECT_EQ(fleet.store().configurations.back().start_skew_s, said.skew_s);
    EXPECT_EQ(fleet.store().configurations.back().start_skew_bound_s, said.bound_s);
    EXPECT_TRUE(Troubles(fleet).empty());
  }
}

// A controller holds its frames up: all units of one bus begin late.
TEST(StartSkew, BeyondTheToleranceIsReportedAndPlannedWithNextTime) {
  const std::uint64_t seed = TestSeed(31);
  InProcessFleet fleet({.count = 61, .units_per_bus = 20, .seed = seed});
  fleet.Run(Seconds(15));
  std::uint64_t configuration = NextConfiguration(&fleet);
  fleet.ApplyRandom(seed);
  ASSERT_TRUE(fleet.RunUntil(
      [&] {
        const ConfigurationView& view = fleet.coordinator().configuration();
        return view.id == configuration && view.state == ConfigurationState::kUploading;
      },
      Seconds(60)));
  const BusId late_bus = fleet.layout().buses()[1];
  ASSERT_TRUE(fleet.RunUntil(
      [&] {
        std::uint32_t armed = 0;
        for (std::uint32_t n = 0; n < fleet.layout().size(); ++n)
          armed += fleet.coordinator().unit({n}).phase == UnitPhase::kArmed ? 1u : 0u;
        return armed == fleet.layout().size();
      },
      Seconds(60)));
  *fleet.world().disturb().faults(late_bus) =
      sim::BusFaults{.late = 1, .late_by = Milliseconds(70)};
  ASSERT_TRUE(IsAboutToStart(&fleet, configuration, Milliseconds(30)));
  const TrueStarts truth = WatchStarts(&fleet);
  *fleet.world().disturb().faults(late_bus) = sim::BusFaults{};
  ASSERT_GT(truth.skew_s(), 0.06);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const StartView said = fleet.coordinator().configuration().starts;
  EXPECT_NEAR(said.skew_s, truth.skew_s(), said.bound_s + kLook_s);
  EXPECT_EQ(fleet.layout().unit(*said.last).bus, late_bus);
  const auto troubles = Troubles(fleet);
  ASSERT_EQ(troubles.size(), 1u);
  EXPECT_EQ(troubles[0].severity, Severity::kError);
  EXPECT_EQ(troubles[0].unit, fleet.layout().unit(*said.last).id);
  EXPECT_EQ(troubles[0].bus, late_bus);
  EXPECT_THAT(troubles[0].text, HasSubstr("(bus " + std::to_string(late_bus.value) + ") began "));
  EXPECT_THAT(troubles[0].text, HasSubstr("more than the 40.0 ms that the plan allowed for"));

  // The next configuration is planned for the measured skew. As long as that holds no alarm is
  // raised.
  configuration = NextConfiguration(&fleet);
  fleet.ApplyRandom(seed + 1);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const StartView& next = fleet.coordinator().configuration().starts;
  EXPECT_NEAR(next.allowed_s, said.least_s, 1e-9) << "for what is proven";
  EXPECT_GT(next.allowed_s, 0.06);
  EXPECT_EQ(Troubles(fleet).size(), 1u);
}

TEST(StartSkew, AClockThatIsTooFarOffIsReported) {
  const std::uint64_t seed = TestSeed(41);
  InProcessFleet fleet({.count = 7, .units_per_bus = 7, .seed = seed, .clock_error_max = 0.012});
  fleet.Run(Seconds(60));
  std::uint32_t reported = 0;
  std::uint32_t off = 0;
  for (std::uint32_t n = 0; n < 7; ++n) {
    const ClockView& clock = fleet.coordinator().unit({n}).clock;
    EXPECT_GE(clock.readings, 4u);
    EXPECT_LT(clock.rate_bound, 200e-6);
    if (std::abs(clock.rate_error) > 0.0053) ++off;
  }
  for (const AlarmRow& alarm : Troubles(fleet)) {
    EXPECT_THAT(alarm.text, HasSubstr("'s clock is off by "));
    ++reported;
  }
  EXPECT_GT(off, 0u);
  EXPECT_GE(reported, off);  // one each
  EXPECT_LE(reported, 7u);
}

// ---- the SYNC line

TEST(StartSkew, IsNextToNothingWithASyncLine) {
  const std::uint64_t seed = TestSeed(51);
  CoordinatorConfig config;
  config.sync_line = true;
  InProcessFleet fleet({.count = 61,
                        .units_per_bus = 20,
                        .seed = seed,
                        .config = config,
                        .clock_error_max = 0.0045});
  fleet.Run(Seconds(15));
  std::uint64_t configuration = NextConfiguration(&fleet);
  fleet.ApplyRandom(seed);
  ASSERT_TRUE(IsAboutToStart(&fleet, configuration, Milliseconds(60)));
  const HostInstant edge = fleet.coordinator().configuration().started;
  const TrueStarts truth = WatchStarts(&fleet);
  EXPECT_EQ(truth.count, 61u);
  EXPECT_EQ(truth.first, truth.last) << "all within one turn of the loop";
  EXPECT_GE(truth.first, edge);
  EXPECT_LE(truth.last - edge, Milliseconds(1));
  ASSERT_TRUE(fleet.RunUntilIdle());
  const StartView& said = fleet.coordinator().configuration().starts;
  EXPECT_LE(said.skew_s, said.bound_s + 0.0002);
  EXPECT_TRUE(Troubles(fleet).empty());
}

TEST(StartSkew, AUnitWithABrokenSyncWireBeginsByItsOwnClockALittleLater) {
  const std::uint64_t seed = TestSeed(61);
  CoordinatorConfig config;
  config.sync_line = true;
  InProcessFleet fleet({.count = 19, .units_per_bus = 10, .seed = seed, .config = config});
  fleet.world().disturb().faults(fleet.id(4))->deaf_to_sync = true;
  fleet.Run(Seconds(15));
  const std::uint64_t configuration = NextConfiguration(&fleet);
  fleet.ApplyRandom(seed);
  ASSERT_TRUE(IsAboutToStart(&fleet, configuration, Milliseconds(60)));
  const TrueStarts truth = WatchStarts(&fleet);
  EXPECT_EQ(truth.count, 19u);
  EXPECT_NEAR(truth.skew_s(), config.sync_lead.seconds(), 0.001);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const StartView& said = fleet.coordinator().configuration().starts;
  EXPECT_EQ(said.last, PositionerIndex{4});
  EXPECT_NEAR(said.skew_s, truth.skew_s(), said.bound_s + kLook_s);
  EXPECT_EQ(fleet.coordinator().configuration().counts.arrived, 19u);
  EXPECT_TRUE(Troubles(fleet).empty());
}

// ---- a whole focal plane

TEST(StartSkew, OfFiftyBusesWithAHundredUnitsEachIsWithinWhatPlansAllowFor) {
  const std::uint64_t seed = TestSeed(71);
  InProcessFleet fleet(
      {.count = 5000, .units_per_bus = 100, .seed = seed, .clock_error_max = 0.0049});
  ASSERT_EQ(fleet.layout().buses().size(), 50u);
  fleet.Run(Seconds(12));
  const std::uint64_t configuration = NextConfiguration(&fleet);
  fleet.ApplyRandom(seed);
  ASSERT_TRUE(IsAboutToStart(&fleet, configuration, Milliseconds(30)));
  const TrueStarts truth = WatchStarts(&fleet, Milliseconds(80));
  ASSERT_TRUE(fleet.RunUntilIdle());
  const StartView& said = fleet.coordinator().configuration().starts;
  const std::uint32_t moved = truth.count;
  EXPECT_GE(moved, 4900u);
  EXPECT_EQ(said.begun, moved);
  EXPECT_EQ(said.reported, said.begun);
  EXPECT_NEAR(said.skew_s, truth.skew_s(), said.bound_s + kLook_s);
  EXPECT_LE(said.least_s, truth.skew_s() + kLook_s);
  EXPECT_GE(said.most_s, truth.skew_s() - kLook_s);
  EXPECT_LE(said.most_s, kAllowed_s);
  RecordProperty("true_ms", std::to_string(1e3 * truth.skew_s()));
  RecordProperty("said_ms", std::to_string(1e3 * said.skew_s));
  RecordProperty("least_ms", std::to_string(1e3 * said.least_s));
  RecordProperty("most_ms", std::to_string(1e3 * said.most_s));
  EXPECT_TRUE(Troubles(fleet).empty());
}

}  // namespace
}  // namespace focalfleet
