#include "daemon/metrics/metrics_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <sstream>

#include "daemon/metrics/metric_groups.h"
#include "daemon/metrics/metrics_sampler.h"
#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

struct Fleet {
  std::uint32_t units = 0;
  std::uint32_t buses = 1;
  std::uint32_t rails = 1;
};

/// The page of a daemon of such a fleet, at its start.
std::string PageOf(const Fleet& fleet) {
  std::vector<Unit> units = MakeHexLayout({.count = fleet.units});
  for (std::uint32_t n = 0; n < fleet.units; ++n) {
    units[n].bus = BusId{n % fleet.buses};
    units[n].node = NodeId{static_cast<std::uint8_t>(n / fleet.buses + 1)};
    units[n].rail = RailId{n % fleet.rails};
  }
  const Layout layout = Layout::Create(std::move(units), {}).value();
  const Coordinator coordinator(&layout, std::vector<UnitDrive>(layout.size()), {}, {});
  NewestValue<const PlannedPower> power;
  NewestValue<const FleetMetrics> out;
  ShellFacts facts;
  facts.buses.resize(layout.buses().size());
  MetricsSampler sampler({.layout = &layout,
                          .facts = [&] { return facts; },
                          .power = &power,
                          .out = &out,
                          .clock = HostClock()});
  sampler.SampleIfDue({.layout = &layout, .coordinator = &coordinator, .now = {}, .at = {}});
  return MetricsText(*out.Take(), WorkCounters{}, ProcessFacts{}, 0);
}

std::size_t SeriesOf(const std::string& page) {
  std::istringstream text(page);
  std::size_t series = 0;
  for (std::string line; std::getline(text, line);) series += line.starts_with('#') ? 0u : 1u;
  return series;
}

TEST(MetricsText, HasAtMostAThousandSeriesForAnyPlate) {
  for (const std::uint32_t buses : {200u, 201u, 512u}) {
    const std::size_t series =
        SeriesOf(PageOf({.units = 20'000, .buses = buses, .rails = buses / 5}));
    EXPECT_LE(series, 1000u) << buses;
    RecordProperty("series_" + std::to_string(buses), static_cast<int>(series));
  }
}

TEST(MetricsText, BusesOfOneGroupAddUpAndShowTheWorst) {
  FleetMetrics fleet;
  for (std::uint32_t n = 0; n < 2 * kBusGroupsMax; ++n)
    fleet.buses.push_back({.bus = BusId{n}, .units = 10, .answering = 9, .errors = n});
  fleet.buses[3].link = LinkState::kOff;
  fleet.buses[2].waiting = 7;
  const std::string page = MetricsText(fleet, WorkCounters{}, ProcessFacts{}, 0);
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_units{bus=\"2-3\"} 20\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_units_answering{bus=\"2-3\"} 18\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_errors_total{bus=\"2-3\"} 5\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_queue_frames{bus=\"2-3\"} 7\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_state{bus=\"2-3\",state=\"off\"} 1\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_state{bus=\"2-3\",state=\"up\"} 0\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_units{bus=\"98-99\"} 20\n"));
}

TEST(MetricsText, EachOfFewBusesIsAGroup) {
  const std::string page = PageOf({.units = 100, .buses = 50, .rails = 1});
  EXPECT_THAT(page, HasSubstr("focalfleet_bus_units{bus=\"49\"} 2\n"));
}

TEST(MetricsText, HasAtMostAThousandSeriesForFiftyBuses) {
  const std::size_t usual = SeriesOf(PageOf({.units = 5000, .buses = 50, .rails = 10}));
  EXPECT_LE(usual, 1000u);
  RecordProperty("series", static_cast<int>(usual));  // docs/metrics.md
  // As many as the buses take, and hardly any: the number of units changes nothing.
  EXPECT_EQ(SeriesOf(PageOf({.units = 6400, .buses = 50, .rails = 10})), usual);
  EXPECT_EQ(SeriesOf(PageOf({.units = 50, .buses = 50, .rails = 10})), usual);
}

TEST(MetricsText, GrowsByThirteenSeriesABusAndThreeARail) {
  const std::size_t one = SeriesOf(PageOf({.units = 100}));
  EXPECT_EQ(SeriesOf(PageOf({.units = 100, .buses = 4})), one + 3 * 13);
  EXPECT_EQ(SeriesOf(PageOf({.units = 100, .rails = 3})), one + 2 * 3);
}

TEST(MetricsText, HasNoBucketsBeyondTwelve) {
  std::istringstream text(PageOf({.units = 10}));
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
