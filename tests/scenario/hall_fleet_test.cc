// These tests run units that measure themselves through the real daemon: orientation from sensors'
// voltages, SQLite, and a reader of the DDS topics. No camera is there. A fleet of 500 runs on
// simulated buses; a few units with faulty sensors run in a simulator of their own.
// No test depends on how fast the machine is. The fleet's clock runs no faster than two busy cores
// can follow, and every wait ends with the event that it waits for.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <map>
#include <optional>
#include <string>

#include "daemon/control/line_client.h"
#include "daemon/dds/status_reader.h"
#include "daemon/store/store_reader.h"
#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/support/fibre_carrier_model.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::FittedFibreCarrierModel;
using test::OwnDomain;
using test::Process;
using test::ScratchFolder;
using test::WaitUntil;

constexpr int kPatienceMs = 170'000;
constexpr const char* kSpeed = "10.0";
// The limits are in the fleet's time. A busy machine needs seconds of real time to send 500 units
// their start, and to receive their arrivals. Units that miss their start are not measured.
constexpr const char* kTiming =
    "[timing]\nstart_delay_ms = 20000\nsettle_margin_ms = 20000\nsilence_limit_ms = 300000\n";

class HallFleet : public ::testing::Test {
 protected:
  HallFleet() { folder_.Put("model.toml", WriteHallModel(FittedFibreCarrierModel())); }
  void Configure(std::uint32_t units, const std::string& bus) {
    layout_.emplace(Layout::Create(MakeHexLayout({.count = units, .sensors = 8}), {}).value());
    folder_.Put("units.csv", WriteUnits(layout_->units()));
    folder_.Put("focalfleet.toml",
                "[fleet]\nunits = \"units.csv\"\n[store]\npath = \"fleet.db\"\n"
                "[control]\nsocket = \"daemon.sock\"\n"
                "[dds]\ndomain = " +
                    std::to_string(OwnDomain()) +
                    "\n[hall]\nmodel = \"model.toml\"\n[clock]\nspeed = " + kSpeed + "\n" +
                    kTiming + "[bus]\n" + bus);
  }

  void Start() {
    daemon_.emplace(std::vector<std::string>{FOCALFLEETD, "--config", Path("focalfleet.toml")},
                    Path("daemon.log"));
    ASSERT_TRUE(WaitUntil(
        [&] {
          const auto status = Ask("status", Json::object());
          return status &&
                 status->value("phases", Json::object()).value("ready", 0u) == layout_->size();
        },
        kPatienceMs))
        << Ask("status", Json::object()).value_or(Json{}).dump();
  }
  Result<Json> Ask(const std::string& verb, const Json& args) {
    auto client = LineClient::Connect(Path("daemon.sock"));
    if (!client) return tl::unexpected<Error>(client.error());
    return client->Call(verb, args, {.silence_max = Seconds(60), .on_progress = {}});
  }
  [[nodiscard]] std::string Targets() const {
    const std::vector<UnitDrive> drives(layout_->size());
    const auto poses = DrawConfiguration(*layout_, drives, {}, Rng::Stream(1, "targets"));
    std::string csv = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < layout_->size(); ++n) {
      const Unit& unit = layout_->units()[n];
      csv += std::to_string(unit.id.value);
      for (const Axis axis : kAxes)
        csv += "," + std::to_string(AngleDeg((*poses)[n][Index(axis)], unit.axis[Index(axis)],
                                             drives[n].axis[Index(axis)]));
      csv += "\n";
    }
    return csv;
  }
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }

  ScratchFolder folder_;  // outlives the processes that write into it
  std::optional<Layout> layout_;
  std::optional<Process> simulator_;
  std::optional<Process> daemon_;
};

using FibreCarriers = std::map<std::uint32_t, FibreCarrierReading>;

bool Agree(const FibreCarrierReading& reported, const FibreCarrierReading& in_store) {
  return reported.verdict == in_store.verdict && reported.trusted == in_store.trusted &&
         (!in_store.solved || (reported.angles_deg == in_store.angles_deg &&
                               reported.covariance_deg2 == in_store.covariance_deg2));
}

// The newest orientation of each unit, once they equal those in the store. Topics are published
// when there is time, the last values last.
FibreCarriers ReadOrientations(StatusReader* reader, const FibreCarriers& in_store) {
  FibreCarriers reported;
  const auto agrees = [&](const auto& entry) {
    const auto found = reported.find(entry.first);
    return found != reported.end() && Agree(found->second, entry.second);
  };
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(kPatienceMs);
  StatusUpdate update;
  while (!std::ranges::all_of(in_store, agrees) && std::chrono::steady_clock::now() < until) {
    EXPECT_TRUE(reader->Wait(std::chrono::milliseconds(100)));
    EXPECT_TRUE(reader->Take(&update));
    EXPECT_EQ(update.malformed, 0u);
    for (const UnitOrientationValue& value : update.orientations)
      reported[value.unit.value] = value.carrier;
  }
  return reported;
}

TEST_F(HallFleet, FiveHundredUnitsMeasureThemselves) {
  constexpr std::uint32_t kUnits = 500;
  Configure(kUnits, "port = \"simulated\"\n[simulated]\nspread = \"real\"\nseed = 3\n");
  Start();
  if (HasFatalFailure()) return;
  const auto done = Ask("apply", {{"targets_csv", Targets()},
                                  {"targets_name", "targets.csv"},
                                  {"wait", true},
                                  {"corrections", 2},
                                  {"tolerance_um", 25}});
  ASSERT_TRUE(done) << done.error().text;
  const Json& rounds = done->at("measured");
  ASSERT_EQ(rounds.size(), 3u) << done->dump();
  for (const Json& round : rounds) {
    EXPECT_FALSE(round.at("camera").get<bool>());
    EXPECT_EQ(round.at("by_sensors"), round.at("measured"));
    std::printf("%s\n", round.dump().c_str());
  }
  // Every unit at rest is measured; 4 % slip or are dead, 8.5 % are off scale (sim/world/spread.h).
  EXPECT_GE(rounds[2].at("measured").get<std::uint32_t>(), 490u)
      << Ask("status", Json::object()).value_or(Json{}).dump();
  EXPECT_GE(rounds[2].at("within_tolerance").get<std::uint32_t>(), 430u);

  const auto reader = StoreReader::Open(Path("fleet.db"));
  ASSERT_TRUE(reader) << reader.error().text;
  const auto rows = (*reader)->Measurements(rounds[2].at("exposure").get<std::uint64_t>());
  ASSERT_TRUE(rows) << rows.error().text;
  ASSERT_EQ(rows->size(), kUnits);
  std::uint32_t stored = 0;
  FibreCarriers carrier_of;
  for (const auto& [row, at, moved_since] : *rows) {
    ASSERT_TRUE(row.carrier) << row.unit.value;
    EXPECT_EQ(row.source, MeasurementSource::kSensors);
    carrier_of[row.unit.value] = *row.carrier;
    if (row.status != MeasurementStatus::kMeasured) continue;
    ++stored;
    EXPECT_EQ(row.carrier->verdict, "ok");
    EXPECT_GT(row.carrier->covariance_deg2[0], 0);
    EXPECT_GT(row.covariance.xx * row.covariance.yy, row.covariance.xy * row.covariance.xy);
  }
  EXPECT_GE(stored, 490u);
  const auto fleet = (*reader)->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  const auto by_sensors = std::ranges::count_if(fleet->vectors, [](const VectorRow& row) {
    return row.origin == Origin::kSensors && row.knowledge[0].witness == Witness::kMeasured;
  });
  EXPECT_GE(by_sensors, 490);

  // A reader that joins late gets the values of the store.
  StatusReader::Options options;
  options.dds = {OwnDomain(), {}};
  auto joined = StatusReader::Create(options);
  ASSERT_TRUE(joined) << joined.error().text;
  const FibreCarriers reported = ReadOrientations(joined->get(), carrier_of);
  ASSERT_EQ(reported.size(), kUnits);
  for (const auto& [unit, carrier] : reported)
    EXPECT_TRUE(Agree(carrier, carrier_of.at(unit)))
        << unit << ": " << carrier.verdict << ", " << carrier.angles_deg[0] << " deg";
  daemon_->Signal(SIGTERM);
  EXPECT_EQ(daemon_->Wait(), 0);
}

// A unit with a faulty sensor, the fault (faults.csv), and the expected verdict.
struct Liar {
  std::uint32_t unit;
  const char* fault;
  int sensor;
  const char* named;
  bool measured;  // the other sensors suffice
};
constexpr Liar kLiars[] = {{4, "sensor_stuck", 3, "stuck v3", false},
                           {9, "sensor_swapped", 2, "swapped v2 v3", false},
                           {14, "sensor_missing", 7, "missing v7", true},
                           {19, "sensor_saturated", 1, "saturated v1", true},
                           {24, "sensor_gain", 5, "gain v5", false}};

TEST_F(HallFleet, WhoseSensorLiesIsNamedInTheStore) {
  constexpr std::uint32_t kUnits = 37;
  Configure(kUnits, "port = \"unix\"\nunix_directory = \"" + folder_.path() + "\"\n");
  std::string faults = "fault,bus_id,unit_id,from_s,to_s,chance,value\n";
  for (const Liar& liar : kLiars)
    faults += std::string(liar.fault) + ",," + std::to_string(liar.unit) + ",,,," +
              std::to_string(liar.sensor) + "\n";
  folder_.Put("faults.csv", faults);
  simulator_.emplace(
      std::vector<std::string>{FOCALFLEET_SIM, "--units", Path("units.csv"), "--faults",
                               Path("faults.csv"), "--unix-directory", folder_.path(), "--control",
                               Path("sim.sock"), "--speed", kSpeed},
      Path("sim.log"));
  ASSERT_TRUE(
      WaitUntil([&] { return LineClient::Connect(Path("sim.sock")).has_value(); }, kPatienceMs));
  Start();
  if (HasFatalFailure()) return;
  const auto done = Ask("apply", {{"targets_csv", Targets()},
                                  {"targets_name", "targets.csv"},
                                  {"wait", true},
                                  {"corrections", 2},
                                  {"tolerance_um", 25}});
  ASSERT_TRUE(done) << done.error().text;
  ASSERT_FALSE(done->at("measured").empty()) << done->dump();
  const Json& last = done->at("measured").back();
  EXPECT_EQ(last.at("measured"), kUnits - 3) << done->dump();

  const auto reader = StoreReader::Open(Path("fleet.db"));
  ASSERT_TRUE(reader) << reader.error().text;
  const auto rows = (*reader)->Measurements(last.at("exposure").get<std::uint64_t>());
  ASSERT_TRUE(rows) << rows.error().text;
  std::map<std::uint32_t, const Liar*> liar_of;
  for (const Liar& liar : kLiars) liar_of[liar.unit] = &liar;
  std::size_t judged = 0;
  for (const auto& [row, at, moved_since] : *rows) {
    ASSERT_TRUE(row.carrier) << row.unit.value;
    const auto found = liar_of.find(row.unit.value);
    if (found == liar_of.end()) {
      EXPECT_EQ(row.carrier->verdict, "ok") << row.unit.value;
      continue;
    }
    ++judged;
    std::printf("unit %u: %s\n", row.unit.value, row.carrier->verdict.c_str());
    EXPECT_EQ(row.status == MeasurementStatus::kMeasured, found->second->measured);
    // A reading or two identify the sensor, but not always the kind of fault.
    const std::string who = "bad v" + std::to_string(found->second->sensor);
    EXPECT_THAT(row.carrier->verdict, ::testing::AnyOf(found->second->named, who, "cannot tell"));
  }
  EXPECT_EQ(judged, std::size(kLiars));
}

}  // namespace
}  // namespace focalfleet
