#include "daemon/metrics/metrics_sampler.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <numeric>

#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

using test::SmallFleet;

class MetricsSamplerTest : public ::testing::Test {
 protected:
  MetricsSamplerTest()
      : sampler_({.layout = &fleet_.layout(),
                  .facts = [this] { return facts_; },
                  .power = &power_,
                  .out = &out_,
                  .clock = HostClock()}) {
    facts_.buses.resize(fleet_.layout().buses().size());
  }
  /// The sample at `now`; null where none was due.
  std::unique_ptr<const FleetMetrics> Sample(HostInstant now) {
    sampler_.SampleIfDue(fleet_.View(now));
    return out_.Take();
  }
  static std::uint64_t CountOf(const HistogramReading& histogram) {
    std::uint64_t count = 0;
    for (const std::uint64_t of_bucket : histogram.counts) count += of_bucket;
    return count;
  }
  void Note(Effects effects, HostInstant now = {}) { sampler_.Note(fleet_.View(now), effects); }

  SmallFleet fleet_{150};  // on two buses, without any replies
  ShellFacts facts_;
  NewestValue<const PlannedPower> power_;
  NewestValue<const FleetMetrics> out_;
  MetricsSampler sampler_;
};

TEST_F(MetricsSamplerTest, SamplesOnceASecond) {
  EXPECT_NE(Sample({0}), nullptr);
  EXPECT_EQ(Sample(HostInstant{0} + Milliseconds(999)), nullptr);
  EXPECT_EQ(sampler_.wake_at(), HostInstant{0} + Milliseconds(1000));
  EXPECT_NE(Sample(HostInstant{0} + Milliseconds(1000)), nullptr);
}

TEST_F(MetricsSamplerTest, CountsEveryUnitOnce) {
  const auto sample = Sample({0});
  EXPECT_EQ(sample->units, 150u);
  EXPECT_EQ(sample->enabled, 150u);
  EXPECT_EQ(sample->by_phase[static_cast<std::size_t>(UnitPhase::kAbsent)], 150u);
  EXPECT_EQ(sample->by_witness[static_cast<std::size_t>(Witness::kUnknown)], 150u);
  ASSERT_EQ(sample->buses.size(), 2u);
  EXPECT_EQ(sample->buses[0].units, 100u);
  EXPECT_EQ(sample->buses[1].units, 50u);
  EXPECT_EQ(sample->buses[1].answering, 0u) << "none has answered yet";
  ASSERT_EQ(sample->rails.size(), 1u);
  EXPECT_EQ(sample->rails[0].units, 150u);
}

TEST_F(MetricsSamplerTest, TakesTheShellsFacts) {
  facts_.version = "1.2.3";
  facts_.steps = 9;
  facts_.dds_trouble = "no port";
  facts_.dds_troubles = 2;
  facts_.buses[1].counters.link_errors = 5;
  facts_.buses[1].waiting = 6;
  facts_.buses[0].transmit_queue.refused = 7;
  facts_.buses[1].transmit_queue.stale = 8;
  const auto sample = Sample({0});
  EXPECT_EQ(sample->version, "1.2.3");
  EXPECT_EQ(sample->steps, 9u);
  EXPECT_TRUE(sample->dds_failing);
  EXPECT_EQ(sample->dds_troubles, 2u);
  EXPECT_EQ(sample->buses[0].errors, 0u);
  EXPECT_EQ(sample->buses[1].errors, 5u);
  EXPECT_EQ(sample->buses[1].waiting, 6u);
  EXPECT_EQ(sample->traffic.discarded, 15u);
}

TEST_F(MetricsSamplerTest, CountsAlarmsByName) {
  Effects effects;
  effects.rows = {AlarmRow{.id = 1, .name = AlarmName::kBusDown},
                  AlarmRow{.id = 2, .name = AlarmName::kUnitSilent},
                  AlarmRow{.id = 3, .name = AlarmName::kBusDown},
                  AlarmRow{.id = 4, .name = AlarmName::kUnitSilent, .times = 0}};
  Note(std::move(effects));
  const auto sample = Sample({0});
  EXPECT_EQ(sample->alarms_by_name[static_cast<std::size_t>(AlarmName::kBusDown)], 2u);
  EXPECT_EQ(sample->alarms_by_name[static_cast<std::size_t>(AlarmName::kUnitSilent)], 1u);
  EXPECT_EQ(std::accumulate(sample->alarms_by_name.begin(), sample->alarms_by_name.end(), 0u), 3u);
}

TEST_F(MetricsSamplerTest, ObservesEachErrorThatWasMeasured) {
  Effects effects;
  effects.rows = {
      MeasurementRow{.unit = UnitId{1}, .place = Pose{}, .error_um = 4},
      MeasurementRow{.unit = UnitId{2}, .place = Pose{}, .error_um = 4000},
      MeasurementRow{.unit = UnitId{3}, .place = Pose{}},  // it had no target
      MeasurementRow{.unit = UnitId{4}, .error_um = 4},    // no place was found
  };
  Note(std::move(effects));
  const auto sample = Sample({0});
  EXPECT_EQ(CountOf(sample->position_error_m), 2u);
  EXPECT_EQ(sample->position_error_m.counts[1], 1u) << "above 2 um, up to 5 um";
  EXPECT_EQ(sample->position_error_m.counts.back(), 1u);
  EXPECT_NEAR(sample->position_error_m.sum, 4.004e-3, 1e-12);
}

TEST_F(MetricsSamplerTest, FollowsAConfigurationToItsEnd) {
  Note({});
  const auto before = Sample({0});
  EXPECT_EQ(before->configuration.began.ns, 0);
  // Unit 1 was measured half a minute before the configuration begins, unit 2 never.
  Effects measured;
  measured.rows = {MeasurementRow{.unit = UnitId{1}, .place = Pose{}}};
  Note(std::move(measured), HostInstant{0} + Seconds(70));
  std::vector<std::optional<Pose>> targets(fleet_.layout().size());
  targets[0] = targets[1] = Pose{};
  const std::vector<Command> commands = {
      {.request = 1, .what = ApplyCommand{.source = "t.csv", .targets = targets}}};
  const HostInstant now = HostInstant{0} + Seconds(100);
  Note(fleet_.Step({.now = now, .commands = commands}), now);
  auto sample = Sample(now);
  EXPECT_TRUE(sample->configuration.busy);
  EXPECT_EQ(sample->configuration.counts.targeted, 2u);
  EXPECT_EQ(CountOf(sample->knowledge_age_s), 1u);
  EXPECT_NEAR(sample->knowledge_age_s.sum, 30, 1e-9);
  EXPECT_EQ(CountOf(sample->configuration_retries), 0u) << "it is not over";
  // No unit answers, so it ends without a motion.
  HostInstant later = now;
  for (int i = 0; i < 100 && sample->configuration.busy; ++i) {
    later = later + Seconds(1);
    Note(fleet_.Step({.now = later, .committed_through = UINT64_MAX}), later);
    sample = Sample(later);
  }
  EXPECT_FALSE(sample->configuration.busy);
  EXPECT_EQ(CountOf(sample->configuration_retries), 1u);
  EXPECT_EQ(sample->configurations_ended[0] + sample->configurations_ended[2], 1u);
}

TEST_F(MetricsSamplerTest, ShowsThePowerOfTheNewestPlan) {
  EXPECT_EQ(Sample({0})->rails[0].power_predicted_W, 0);
  power_.Put(std::make_unique<const PlannedPower>(PlannedPower{
      .rail_peak_W = {{RailId{0}, 12}}, .peak_W = 13, .rail_limit_W = 20, .limit_W = 30}));
  for (int second = 1; second < 3; ++second) {
    const auto sample = Sample(HostInstant{0} + Seconds(second));
    EXPECT_EQ(sample->rails[0].power_predicted_W, 12);
    EXPECT_EQ(sample->power_predicted_W, 13);
    EXPECT_EQ(sample->rail_limit_W, 20);
    EXPECT_EQ(sample->limit_W, 30);
  }
}

}  // namespace
}  // namespace focalfleet
