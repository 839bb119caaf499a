#include <dds/dds.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <deque>
#include <functional>
#include <map>

#include "daemon/dds/cyclone.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_reader.h"
#include "focalfleet.h"
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/taken_ports.h"

namespace focalfleet {
namespace {

using test::ClientProcess;
using test::OwnDomain;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience(20);  // far above anything that is measured

DdsOptions Options(std::string config = {}) { return {OwnDomain(), std::move(config)}; }

std::unique_ptr<StatusPublisher> MakePublisher(const DdsOptions& options = Options()) {
  auto publisher = StatusPublisher::Create(options);
  EXPECT_TRUE(publisher) << (publisher ? "" : publisher.error().text);
  return publisher ? std::move(*publisher) : nullptr;
}

std::unique_ptr<StatusReader> MakeReader(bool units = true) {
  StatusReader::Options options;
  options.dds = Options();
  options.units = units;
  auto reader = StatusReader::Create(options);
  EXPECT_TRUE(reader) << (reader ? "" : reader.error().text);
  return reader ? std::move(*reader) : nullptr;
}

// The client in C reads the configuration that is installed; the project's own ends have it built
// in.
ClientProcess LateJoiner(int units, int alarms, int wait_ms) {
  return ClientProcess({"/usr/bin/env", "CYCLONEDDS_URI=" LOOPBACK_URI, LATE_JOINER,
                        std::to_string(OwnDomain()), std::to_string(units), std::to_string(alarms),
                        std::to_string(wait_ms)});
}

// Seen holds all that a reader has received so far, by id, with how often.
struct Seen {
  std::map<std::uint32_t, UnitStatusValue> units;
  std::map<std::uint32_t, BusStatusValue> buses;
  std::map<std::uint64_t, int> alarms;
  std::map<std::uint64_t, AlarmValue> alarm_values;
  std::optional<FleetStatusValue> fleet;
  std::optional<ConfigurationProgressValue> configuration;
  std::optional<AuditHeadValue> audit_head;
  std::uint32_t malformed = 0;
};

// Takes samples until `enough`; false where `enough` never became true.
bool TakeUntil(StatusReader& reader, Seen* seen, const std::function<bool()>& enough) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  StatusUpdate update;
  while (!enough()) {
    if (std::chrono::steady_clock::now() > until) return false;
    EXPECT_TRUE(reader.Wait(std::chrono::milliseconds(100)));
    EXPECT_TRUE(reader.Take(&update));
    for (const auto& unit : update.units) seen->units[unit.unit.value] = unit;
    for (const auto& bus : update.buses) seen->buses[bus.bus.value] = bus;
    for (const auto& alarm : update.alarms) {
      ++seen->alarms[alarm.row.id];
      seen->alarm_values[alarm.row.id] = alarm;
    }
    if (update.fleet) seen->fleet = update.fleet;
    if (update.configuration) seen->configuration = update.configuration;
    if (update.audit_head) seen->audit_head = update.audit_head;
    seen->malformed += update.malformed;
  }
  return true;
}

AlarmValue Alarm(std::uint64_t id, std::string text = {}) {
  AlarmValue alarm;
  alarm.row.id = id;
  alarm.row.text = std::move(text);
  alarm.row.name = AlarmName::kBusDown;
  return alarm;
}

std::vector<UnitStatusValue> Units(std::size_t n) {
  std::vector<UnitStatusValue> units(n);
  for (std::size_t i = 0; i < n; ++i) units[i].unit = {static_cast<std::uint32_t>(i + 1)};
  return units;
}

UnitStatusValue SomeUnit() {
  UnitStatusValue unit;
  unit.unit = {4711};
  unit.serial = {815};
  unit.bound_serial = {816};
  unit.bus = {12};
  unit.node = {99};
  unit.at = {1'700'000'000'123'456'789};
  unit.witness = {Witness::kInterval, Witness::kMeasured};
  unit.low_deg = {-1.5, 2.25};
  unit.high_deg = {-1.25, 2.25};
  unit.x_fp_mm = 400.125;
  unit.y_fp_mm = -3.5;
  unit.target_deg = {11, 12};
  unit.move = {65535};
  unit.phase = UnitPhase::kSilent;
  unit.reported_state = UnitState::kHostLost;
  unit.fault = FaultCode::kDriver;
  unit.outcome = TargetOutcome::kFailed;
  unit.enabled = false;
  return unit;
}

TEST(Status, UnitComesAcrossWithEveryField) {
  auto publisher = MakePublisher();
  auto reader = MakeReader();
  const UnitStatusValue sent = SomeUnit();
  EXPECT_EQ(publisher->Publish(std::span(&sent, 1)), 1u);
  publisher->Flush();
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.units.contains(4711); }));
  const UnitStatusValue& got = seen.units[4711];
  EXPECT_EQ(got.serial, sent.serial);
  EXPECT_EQ(got.bound_serial, sent.bound_serial);
  EXPECT_EQ(got.bus, sent.bus);
  EXPECT_EQ(got.node, sent.node);
  EXPECT_EQ(got.at, sent.at);
  EXPECT_EQ(got.witness, sent.witness);
  EXPECT_EQ(got.low_deg, sent.low_deg);
  EXPECT_EQ(got.high_deg, sent.high_deg);
  EXPECT_EQ(got.x_fp_mm, sent.x_fp_mm);
  EXPECT_EQ(got.y_fp_mm, sent.y_fp_mm);
  EXPECT_EQ(got.target_deg, sent.target_deg);
  EXPECT_EQ(got.move, sent.move);
  EXPECT_EQ(got.phase, sent.phase);
  EXPECT_EQ(got.reported_state, sent.reported_state);
  EXPECT_EQ(got.fault, sent.fault);
  EXPECT_EQ(got.outcome, sent.outcome);
  EXPECT_FALSE(got.enabled);
  EXPECT_EQ(publisher->counters().samples, 1u);
  EXPECT_EQ(publisher->counters().payload_bytes, 102u);
}

TEST(Status, FleetBusAndConfigurationComeAcross) {
  auto publisher = MakePublisher();
  auto reader = MakeReader(false);
  FleetStatusValue fleet;
  fleet.at = {5};
  fleet.started = {4};
  fleet.version = "0.1.0";
  fleet.units = 5000;
  fleet.enabled = 4990;
  fleet.units_by_phase[12] = 7;
  fleet.units_by_witness[4] = 8;
  fleet.configuration = 3;
  fleet.bus_load_max = 0.5;
  fleet.busy = true;
  BusStatusValue bus;
  bus.bus = {7};
  bus.view.link = LinkState::kOff;
  bus.view.frames_sent = UINT64_MAX;
  bus.view.load = 0.25;
  bus.view.retries = 3;
  bus.view.upload.measured_s = 0.091;
  ConfigurationProgressValue configuration;
  configuration.view.id = 3;
  configuration.view.source = "night.csv";
  configuration.view.state = ConfigurationState::kStopped;
  configuration.view.counts.arrived = 4999;
  configuration.view.peak_power_W = 12.5;
  configuration.view.frames = 90'000;
  configuration.view.starts = {
      .begun = 5000, .reported = 4998, .skew_s = 0.002, .bound_s = 0.0005, .allowed_s = 0.04};
  configuration.view.upload = {
      .bits_predicted = 4'500'000, .bits = 4'600'000, .predicted_s = 0.09, .measured_s = 0.092};
  ASSERT_TRUE(publisher->Publish(fleet));
  EXPECT_EQ(publisher->Publish(std::span(&bus, 1)), 1u);
  ASSERT_TRUE(publisher->Publish(configuration));
  const std::string head = "18446744073709551615:" + std::string(64, 'f');  // the longest one
  ASSERT_TRUE(publisher->Publish(AuditHeadValue{.at = {6}, .head = head}));
  publisher->Flush();
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] {
    return seen.fleet && seen.configuration && seen.audit_head && seen.buses.contains(7);
  }));
  EXPECT_EQ(seen.audit_head->at, WallTime{6});
  EXPECT_EQ(seen.audit_head->head, head);
  EXPECT_EQ(seen.fleet->version, "0.1.0");
  EXPECT_EQ(seen.fleet->started, WallTime{4});
  EXPECT_EQ(seen.fleet->enabled, 4990u);
  EXPECT_EQ(seen.fleet->units_by_phase, fleet.units_by_phase);
  EXPECT_EQ(seen.fleet->units_by_witness, fleet.units_by_witness);
  EXPECT_TRUE(seen.fleet->busy);
  EXPECT_FALSE(seen.fleet->store_failing);
  EXPECT_EQ(seen.buses[7].view.frames_sent, UINT64_MAX);
  EXPECT_EQ(seen.buses[7].view.link, LinkState::kOff);
  EXPECT_EQ(seen.buses[7].view.retries, 3u);
  EXPECT_EQ(seen.configuration->view.source, "night.csv");
  EXPECT_EQ(seen.configuration->view.state, ConfigurationState::kStopped);
  EXPECT_EQ(seen.configuration->view.counts.arrived, 4999u);
  EXPECT_EQ(seen.configuration->view.frames, 90'000u);
  EXPECT_EQ(seen.configuration->view.starts.begun, 5000u);
  EXPECT_EQ(seen.configuration->view.starts.reported, 4998u);
  EXPECT_EQ(seen.configuration->view.starts.skew_s, 0.002);
  EXPECT_EQ(seen.configuration->view.starts.bound_s, 0.0005);
  EXPECT_EQ(seen.configuration->view.starts.allowed_s, 0.04);
  EXPECT_EQ(seen.configuration->view.upload.bits_predicted, 4'500'000u);
  EXPECT_EQ(seen.configuration->view.upload.bits, 4'600'000u);
  EXPECT_EQ(seen.configuration->view.upload.predicted_s, 0.09);
  EXPECT_EQ(seen.configuration->view.upload.measured_s, 0.092);
  EXPECT_EQ(seen.buses[7].view.upload.measured_s, 0.091);
  EXPECT_TRUE(reader->writer_alive());
}

TEST(Status, ACodeOutsideItsEnumIsNotWritten) {
  auto publisher = MakePublisher();
  auto units = Units(3);
  units[2].phase = static_cast<UnitPhase>(kUnitPhaseCount);
  const auto written = publisher->Publish(units);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(written.error().text, HasSubstr("unit 3: its phase"));
  UnitStatusValue unit = SomeUnit();
  unit.witness[1] = static_cast<Witness>(5);
  EXPECT_FALSE(publisher->Publish(std::span(&unit, 1)));
  unit = SomeUnit();
  unit.fault = static_cast<FaultCode>(kFaultCodeCount);
  EXPECT_FALSE(publisher->Publish(std::span(&unit, 1)));
  AlarmValue alarm = Alarm(1);
  alarm.row.severity = static_cast<Severity>(3);
  EXPECT_FALSE(publisher->Publish(alarm));
  ConfigurationProgressValue configuration;
  configuration.view.state = static_cast<ConfigurationState>(6);
  EXPECT_FALSE(publisher->Publish(configuration));
  EXPECT_EQ(publisher->counters().samples, 0u);
}

TEST(Status, ALaterVersionsCodeIsCountedNotShown) {
  auto reader = MakeReader();
  const auto participant = dds_internal::Participant::Join(Options());
  ASSERT_TRUE(participant);
  const auto topic =
      dds_internal::MakeTopic(*participant, focalfleet_UnitStatus_desc, dds_internal::kUnitTopic);
  const auto writer = dds_internal::MakeWriter(*participant, *topic);
  ASSERT_TRUE(writer);
  focalfleet_UnitStatus sample{};
  sample.unit_id = 1;
  sample.phase = kUnitPhaseCount;
  ASSERT_EQ(dds_write(*writer, &sample), DDS_RETCODE_OK);
  sample.unit_id = 2;
  sample.phase = 0;
  ASSERT_EQ(dds_write(*writer, &sample), DDS_RETCODE_OK);
  dds_write_flush(*writer);
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.malformed > 0 && !seen.units.empty(); }));
  EXPECT_EQ(seen.malformed, 1u);
  EXPECT_FALSE(seen.units.contains(1));
}

TEST(Status, TextIsCutAtItsBoundBetweenCharacters) {
  auto publisher = MakePublisher();
  auto reader = MakeReader();
  std::string text(254, 'a');
  text += "\xc3\xbc";  // two bytes; 256 are one too many
  ASSERT_TRUE(publisher->Publish(Alarm(1, text)));
  ASSERT_TRUE(publisher->Publish(Alarm(2, std::string(255, 'b'))));
  ASSERT_TRUE(publisher->Publish(Alarm(3, std::string(100'000, 'c'))));
  publisher->Flush();
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.alarms.size() == 3; }));
  EXPECT_EQ(seen.alarm_values[1].row.text, std::string(254, 'a'));
  EXPECT_EQ(seen.alarm_values[2].row.text, std::string(255, 'b'));
  EXPECT_EQ(seen.alarm_values[2].row.name, AlarmName::kBusDown);
  EXPECT_EQ(seen.alarm_values[3].row.text, std::string(255, 'c'));
}

TEST(Status, AnAlarmIsReportedOnceAndOldOnesNotToLateJoiners) {
  constexpr std::uint64_t kAlarms = StatusPublisher::kAlarmsKept + 300;
  auto publisher = MakePublisher();
  auto early = MakeReader();
  Seen early_seen;
  for (std::uint64_t id = 1; id <= kAlarms; ++id) {
    ASSERT_TRUE(publisher->Publish(Alarm(id, "x")));
    ASSERT_TRUE(publisher->Publish(Alarm(id, "again")));
    publisher->Flush();
  }
  ASSERT_TRUE(TakeUntil(*early, &early_seen, [&] { return early_seen.alarms.contains(kAlarms); }));
  EXPECT_EQ(early_seen.alarms.size(), kAlarms);
  for (const auto& [id, times] : early_seen.alarms) EXPECT_EQ(times, 1) << id;

  auto late = MakeReader();
  Seen late_seen;
  ASSERT_TRUE(TakeUntil(*late, &late_seen,
                        [&] { return late_seen.alarms.size() == StatusPublisher::kAlarmsKept; }));
  EXPECT_EQ(late_seen.alarms.begin()->first, 301u);
  EXPECT_EQ(late_seen.alarms.rbegin()->first, kAlarms);
}

// The reader is a client that shares no code with the project.
TEST(Status, LateJoinerInCSeesAllUnitsAndEachAlarmOnce) {
  auto publisher = MakePublisher();
  const auto units = Units(5000);
  for (int round = 0; round < 20; ++round) EXPECT_EQ(publisher->Publish(units), units.size());
  for (std::uint64_t id = 1; id <= 40; ++id) ASSERT_TRUE(publisher->Publish(Alarm(id)));
  publisher->Flush();
  for (int join = 0; join < 3; ++join) {
    ClientProcess client = LateJoiner(5000, 40, 10'000);
    const std::string line = client.Line();
    EXPECT_THAT(line, ::testing::StartsWith("units=5000 alarms=40 alarms_twice=0 ms="));
    const int ms = std::atoi(line.substr(line.rfind('=') + 1).c_str());
    EXPECT_LE(ms, 2000) << line;
    EXPECT_EQ(client.Finish(), 0);
  }
}

TEST(Status, AClientThatIsThereFromTheStartSeesEachAlarmOnce) {
  ClientProcess client = LateJoiner(100, 40, 20'000);
  auto publisher = MakePublisher();
  const auto units = Units(100);
  std::uint64_t id = 0;
  while (!client.Ended()) {
    if (publisher->unit_readers() == 0) continue;
    EXPECT_TRUE(publisher->Publish(units));
    if (id < 40) {
      ASSERT_TRUE(publisher->Publish(Alarm(++id)));
    }
    publisher->Flush();
  }
  EXPECT_THAT(client.Line(), ::testing::StartsWith("units=100 alarms=40 alarms_twice=0"));
}

TEST(Status, AStoppedReaderCostsNoTimeAndCatchesUp) {
  auto publisher = MakePublisher();
  ClientProcess client = LateJoiner(5000, 3, 60'000);
  while (publisher->unit_readers() == 0) ASSERT_FALSE(client.Ended());
  client.Signal(SIGSTOP);
  auto units = Units(5000);
  // A write that waited for its reader would block here for good, because 10 MB exceed any buffer.
  for (int round = 0; round < 20; ++round) {
    for (auto& unit : units) unit.at = {round};
    EXPECT_EQ(publisher->Publish(units), units.size());
    publisher->Flush();
  }
  for (std::uint64_t id = 1; id <= 3; ++id) ASSERT_TRUE(publisher->Publish(Alarm(id)));
  publisher->Flush();
  client.Signal(SIGCONT);
  EXPECT_THAT(client.Line(), ::testing::StartsWith("units=5000 alarms=3 alarms_twice=0"));
  EXPECT_EQ(publisher->counters().deferred, 0u);
}

TEST(Status, AKilledDaemonIsNoticed) {
  auto reader = MakeReader();
  EXPECT_FALSE(reader->writer_seen());
  ClientProcess talker({TALKER, std::to_string(OwnDomain()), "10", "1"});
  ASSERT_EQ(talker.Line(), "ready");
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.units.size() == 10; }));
  EXPECT_TRUE(reader->writer_alive());
  talker.Signal(SIGKILL);
  EXPECT_TRUE(TakeUntil(*reader, &seen, [&] { return !reader->writer_alive(); }));
  EXPECT_TRUE(reader->writer_seen());
  // The next daemon is a new writer, and readers receive its samples, too.
  ClientProcess next({TALKER, std::to_string(OwnDomain()), "11", "1"});
  EXPECT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.units.size() == 11; }));
  EXPECT_TRUE(reader->writer_alive());
}

TEST(Status, ADaemonThatEndsIsNoticed) {
  auto reader = MakeReader();
  ClientProcess talker({TALKER, std::to_string(OwnDomain()), "1", "0"});
  ASSERT_EQ(talker.Line(), "ready");
  Seen seen;
  ASSERT_TRUE(TakeUntil(*reader, &seen, [&] { return reader->writer_alive(); }));
  EXPECT_EQ(talker.Finish(), 0);
  EXPECT_TRUE(TakeUntil(*reader, &seen, [&] { return !reader->writer_alive(); }));
}

// Forty are more than there were places for (docs/adr/0006). A hundred take a minute of both cores,
// most of it for discovery.
TEST(Status, FortyReadersOnOneHostAllSeeEverything) {
  auto publisher = MakePublisher();
  ASSERT_EQ(publisher->Publish(Units(200)), 200u);
  for (std::uint64_t id = 1; id <= 3; ++id) ASSERT_TRUE(publisher->Publish(Alarm(id)));
  publisher->Flush();
  std::deque<ClientProcess> readers;
  for (int i = 0; i < 40; ++i)
    readers.emplace_back(std::vector<std::string>{"/usr/bin/env", "CYCLONEDDS_URI=" LOOPBACK_URI,
                                                  LATE_JOINER, std::to_string(OwnDomain()), "200",
                                                  "3", "60000"});
  for (ClientProcess& reader : readers) {
    EXPECT_THAT(reader.Line(), HasSubstr("units=200 alarms=3 alarms_twice=0"));
    EXPECT_EQ(reader.Finish(), 0);
  }
}

TEST(Status, WithoutAFreePortJoiningFailsAndGoesLaterInTheSameProcess) {
  {
    const test::TakenPorts taken(OwnDomain());
    const auto publisher = StatusPublisher::Create(Options());
    ASSERT_FALSE(publisher);
    EXPECT_EQ(publisher.error().code, ErrorCode::kUnavailable);
    EXPECT_FALSE(StatusPublisher::Create(Options())) << "and so it does again";
  }
  auto publisher = MakePublisher();
  auto reader = MakeReader();
  ASSERT_EQ(publisher->Publish(Units(10)), 10u);
  publisher->Flush();
  Seen seen;
  EXPECT_TRUE(TakeUntil(*reader, &seen, [&] { return seen.units.size() == 10; }));
}

TEST(Status, TheEnvironmentDoesNotDecideWhereStatusGoes) {
  ::setenv("CYCLONEDDS_URI",
           "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='no_such_interface'/>"
           "</Interfaces></General></Domain></CycloneDDS>",
           1);
  auto publisher = MakePublisher();
  ::unsetenv("CYCLONEDDS_URI");
  EXPECT_TRUE(publisher);
}

TEST(Status, WaitComesBackWithoutNews) {
  auto reader = MakeReader();
  EXPECT_EQ(reader->Wait(std::chrono::milliseconds(1)), false);
}

TEST(Status, BadConfigurationIsAnError) {
  const auto publisher =
      StatusPublisher::Create(Options("<CycloneDDS><Domain><Nonsense>1</Nonsense>"));
  ASSERT_FALSE(publisher);
  EXPECT_EQ(publisher.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(publisher.error().text, HasSubstr("DDS"));
  EXPECT_TRUE(MakePublisher());  // the domain still works afterwards
}

}  // namespace
}  // namespace focalfleet
