// Status that was published before the domain could be joined, through real DDS.
#include "daemon/status/buffered_status_publisher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <semaphore>

#include "daemon/dds/status_reader.h"
#include "tests/daemon/dds/own_domain.h"

namespace focalfleet {
namespace {

using test::OwnDomain;

constexpr std::chrono::seconds kPatience(60);  // limit for a hang; nothing is timed

struct Seen {
  std::map<std::uint32_t, UnitStatusValue> units;
  std::map<std::uint32_t, BusStatusValue> buses;
  std::map<std::uint64_t, int> alarms;
  std::optional<FleetStatusValue> fleet;
  std::optional<ConfigurationProgressValue> configuration;
};

StatusBatch Batch(std::uint32_t first, std::uint32_t last, std::uint32_t serial) {
  StatusBatch batch;
  for (std::uint32_t id = first; id <= last; ++id) {
    UnitStatusValue unit;
    unit.unit = {id};
    unit.serial = {serial};
    batch.units.push_back(unit);
  }
  return batch;
}

AlarmValue Alarm(std::uint64_t id) {
  AlarmValue alarm;
  alarm.row.id = id;
  return alarm;
}

TEST(BufferedStatusPublisher, PublishesTheWholeStateOnceItCanJoin) {
  std::counting_semaphore<> may_join(0);
  std::vector<std::string> reported;
  BufferedStatusPublisher publisher(
      {.join = [&]() -> Result<std::unique_ptr<StatusPublisher>> {
         if (!may_join.try_acquire()) return Fail(ErrorCode::kUnavailable, "no port is left");
         return StatusPublisher::Create({.domain = OwnDomain()});
       },
       .tell = [&](const std::string& text) { reported.push_back(text); },
       .period = std::chrono::milliseconds(5)});
  // Batches come one after the other, with the newest values last.
  StatusBatch first = Batch(1, 300, 1);
  first.fleet = FleetStatusValue{};
  first.fleet->units = 300;
  first.configuration = ConfigurationProgressValue{};
  first.buses.resize(2);
  first.buses[1].bus = {1};
  EXPECT_FALSE(publisher.Publish(first)) << "nothing that would be taken soon";
  EXPECT_FALSE(publisher.Publish(Batch(100, 200, 2)));
  const std::uint64_t alarms = StatusPublisher::kAlarmsKept + 3;
  for (std::uint64_t id = 1; id <= alarms; ++id) publisher.Publish(Alarm(id));
  EXPECT_EQ(publisher.samples(), 0u);

  auto reader = StatusReader::Create({.dds = {.domain = OwnDomain(), .config_xml = {}}}).value();
  may_join.release();
  Seen seen;
  StatusUpdate update;
  const auto until = std::chrono::steady_clock::now() + kPatience;
  const auto enough = [&] {
    return seen.units.size() == 300 && seen.buses.size() == 2 &&
           seen.alarms.size() == StatusPublisher::kAlarmsKept && seen.fleet && seen.configuration;
  };
  while (!enough() && std::chrono::steady_clock::now() < until) {
    publisher.Publish(StatusBatch{});  // as the status thread does repeatedly
    ASSERT_TRUE(reader->Wait(std::chrono::milliseconds(10)));
    ASSERT_TRUE(reader->Take(&update));
    for (const auto& unit : update.units) seen.units[unit.unit.value] = unit;
    for (const auto& bus : update.buses) seen.buses[bus.bus.value] = bus;
    for (const auto& alarm : update.alarms) ++seen.alarms[alarm.row.id];
    if (update.fleet) seen.fleet = update.fleet;
    if (update.configuration) seen.configuration = update.configuration;
  }
  ASSERT_TRUE(enough());
  EXPECT_EQ(seen.units[99].serial, SerialNumber{1});
  EXPECT_EQ(seen.units[100].serial, SerialNumber{2}) << "the newest value";
  EXPECT_TRUE(seen.alarms.contains(alarms)) << "of more alarms than are kept, the newest";
  EXPECT_EQ(publisher.samples(), 300u + 2 + StatusPublisher::kAlarmsKept + 1 + 1) << "each once";
  ASSERT_EQ(reported.size(), 2u)
      << "the failure once, however often it was tried, and that it is over";
  EXPECT_EQ(reported[0], "no port is left");
  EXPECT_EQ(reported[1], "");
}

}  // namespace
}  // namespace focalfleet
