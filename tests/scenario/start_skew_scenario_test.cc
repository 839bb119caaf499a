// When units begin, by their own clocks: what the coordinator makes of it, beside what is true.

#include <gtest/gtest.h>

#include <cmath>

#include "fleet/plan/planner.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/support/seed.h"

namespace focalfleet::testing {
namespace {

constexpr double kAllowed_s = 2 * PlanOptions{}.start_skew_s;

/// Applies, and looks at every unit's state from just before the start on: when each began. By the
/// turns of the loop, 0.2 ms.
struct TrueStarts {
  HostInstant first = kNever;
  HostInstant last{INT64_MIN};
  std::uint32_t count = 0;
  [[nodiscard]] double skew_s() const { return (last - first).seconds(); }
};
TrueStarts WatchStarts(InProcessFleet* fleet) {
  TrueStarts starts;
  std::vector<bool> seen(fleet->layout().size());
  const std::uint64_t id = fleet->coordinator().configuration().id;
  EXPECT_TRUE(fleet->RunUntil(
      [&] {
        const ConfigurationView& view = fleet->coordinator().configuration();
        return view.id != id && view.started != kNever &&
               fleet->now() >= view.started - Milliseconds(60);
      },
      Seconds(120)));
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
      Milliseconds(250));
  return starts;
}

TEST(StartSkew, IsMeasuredAsItIs) {
  for (std::uint64_t k = 0; k < 6; ++k) {
    const std::uint64_t seed = TestSeed(21) + k;
    SCOPED_TRACE(seed);
    InProcessFleet fleet(
        {.count = 91, .units_per_bus = 20, .seed = seed, .clock_error_max = 0.0045});
    fleet.Run(Milliseconds(1500 + 4000 * static_cast<std::int64_t>(k)));
    fleet.ApplyRandom(seed);
    const TrueStarts truth = WatchStarts(&fleet);
    ASSERT_TRUE(fleet.RunUntilIdle());
    const StartView& said = fleet.coordinator().configuration().starts;
    EXPECT_EQ(said.round, 1u);
    EXPECT_EQ(said.told, said.begun);
    EXPECT_EQ(said.told, truth.count);
    EXPECT_NEAR(said.skew_s, truth.skew_s(), said.bound_s + 0.0004);
    EXPECT_LE(said.skew_s + said.bound_s, said.allowed_s);
    EXPECT_EQ(said.allowed_s, kAllowed_s);
    // Half a percent of the quarter of a second that clocks count down.
    EXPECT_LE(truth.skew_s(), 0.004);
    for (const AlarmRow& alarm : fleet.store().alarms) EXPECT_EQ(alarm.severity, Severity::kInfo) << alarm.text;
    std::printf("true %.2f ms, said %.2f +- %.2f ms, %u of %u\n", truth.skew_s() * 1e3, said.skew_s * 1e3, said.bound_s * 1e3, said.told, said.begun);
  }
}

}  // namespace
}  // namespace focalfleet::testing
