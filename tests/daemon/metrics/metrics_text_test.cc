#include "daemon/metrics/metrics_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <sstream>

#include "daemon/metrics/metrics_sampler.h"
#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// The page of a daemon of so many units, at its start.
std::string PageOf(const HexLayoutOptions& options) {
  const Layout layout = Layout::Create(MakeHexLayout(options), {}).value();
  const Coordinator coordinator(&layout, std::vector<UnitDrive>(layout.size()), {}, {});
  NewestValue<const PlannedPower> power;
  NewestValue<const FleetMetrics> out;
  ShellFacts facts;
  facts.buses.resize(layout.buses().size());
  MetricsSampler sampler(
      {.layout = &layout, .facts = [&] { return facts; }, .power = &power, .out = &out});
  sampler.SampleIfDue({.layout = &layout, .coordinator = &coordinator, .now = {}, .at = {}});
  return MetricsText(*out.Take(), WorkCounters{}, ProcessFacts{}, 0);
}

std::size_t SeriesOf(const std::string& page) {
  std::istringstream text(page);
  std::size_t series = 0;
  for (std::string line; std::getline(text, line);) series += line.starts_with('#') ? 0 : 1;
  return series;
}

TEST(MetricsText, HasAtMostAThousandSeriesForFiftyBuses) {
  // The most that a bus takes, what is usual, and hardly any.
  const std::size_t many = SeriesOf(PageOf({.count = 6400, .units_per_bus = 128}));
  const std::size_t usual = SeriesOf(PageOf({.count = 5000, .units_per_bus = 100}));
  const std::size_t few =
      SeriesOf(PageOf({.count = 500, .units_per_bus = 10, .units_per_rail = 50}));
  EXPECT_LE(many, 1000u);
  EXPECT_LE(usual, 1000u);
  EXPECT_EQ(few, usual) << "the number of units changes nothing";
  EXPECT_EQ(many - usual, 3 * 3u) << "three more rails";
  RecordProperty("series of 50 buses", static_cast<int>(usual));
}

TEST(MetricsText, GrowsByFourteenSeriesABusAndThreeARail) {
  const std::size_t one = SeriesOf(PageOf({.count = 200, .units_per_bus = 100}));
  const std::size_t more = SeriesOf(PageOf({.count = 300, .units_per_bus = 100}));
  const std::size_t rails =
      SeriesOf(PageOf({.count = 300, .units_per_bus = 100, .units_per_rail = 100}));
  EXPECT_EQ(more - one, 14u);
  EXPECT_EQ(rails - more, 6u);
}

TEST(MetricsText, HasNoBucketsBeyondTwelve) {
  std::istringstream text(PageOf({.count = 10}));
  std::map<std::string, int> buckets;
  for (std::string line; std::getline(text, line);)
    if (const std::size_t at = line.find("_bucket{"); at != std::string::npos)
      ++buckets[line.substr(0, at)];
  EXPECT_EQ(buckets.size(), 6u);
  for (const auto& [name, count] : buckets) EXPECT_LE(count, 12) << name;
}

TEST(MetricsText, ShowsValuesInBaseUnitsAndNamesNoUnit) {
  FleetMetrics fleet;
  fleet.version = "1\"2";
  fleet.started = WallTime{1'500'000'000};
  fleet.configuration.worst_error_um = 25;
  fleet.configuration.state = ConfigurationState::kMoving;
  fleet.buses = {{.bus = BusId{3}, .link = LinkState::kPassive, .load = 0.25}};
  WorkCounters work;
  work.commit_s.Observe(0.003);
  const std::string page = MetricsText(fleet, work, {}, 4096);
  for (const char* line :
       {"focalfleet_build_info{version=\"1\\\"2\"} 1", "process_start_time_seconds 1.5",
        "focalfleet_worst_unit_error_meters 2.5e-05",
        "focalfleet_configuration_state{state=\"moving\"} 1",
        "focalfleet_configuration_state{state=\"done\"} 0",
        "focalfleet_bus_state{bus=\"3\",state=\"passive\"} 1",
        "focalfleet_bus_state{bus=\"3\",state=\"up\"} 0",
        "focalfleet_bus_load_ratio{bus=\"3\"} 0.25", "focalfleet_store_size_bytes 4096",
        "focalfleet_store_commit_seconds_bucket{le=\"0.002\"} 0",
        "focalfleet_store_commit_seconds_bucket{le=\"0.005\"} 1",
        "focalfleet_store_commit_seconds_bucket{le=\"+Inf\"} 1"})
    EXPECT_THAT(page, HasSubstr("\n" + std::string(line) + "\n"));
  EXPECT_THAT(page, Not(HasSubstr("unit=")));
}

}  // namespace
}  // namespace focalfleet
