// 500 units that measure themselves, through the real daemon: simulated buses, orientation from
// sensors' voltages, SQLite, and a reader of the DDS topics. No camera is there.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include "daemon/control/line_client.h"
#include "daemon/dds/status_reader.h"
#include "daemon/store/store.h"
#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/spine_model.h"

namespace focalfleet::testing {
namespace {

constexpr std::uint32_t kUnits = 500;
constexpr int kPatienceMs = 120'000;

class HallFleet : public ::testing::Test {
 protected:
  HallFleet()
      : directory_(std::filesystem::temp_directory_path() /
                   ("focalfleet_hall_" + std::to_string(getpid()))),
        layout_(Layout::Create(MakeHexLayout({.count = kUnits, .sensors = 8}), {}).value()) {
    std::filesystem::create_directories(directory_);
    Write("units.csv", WriteUnits(layout_.units()));
    Write("model.toml", WriteHallModel(FittedSpineModel()));
    Write("focalfleet.toml",
          "[fleet]\nunits = \"units.csv\"\n[store]\npath = \"fleet.db\"\n"
          "[control]\nsocket = \"daemon.sock\"\n"
          "[dds]\ndomain = " +
              std::to_string(OwnDomain()) +
              "\n[bus]\nport = \"simulated\"\n[hall]\nmodel = \"model.toml\"\n"
              "[clock]\nspeed = 30.0\n[simulated]\nspread = \"real\"\nseed = 3\n");
  }
  ~HallFleet() override {
    if (HasFailure()) {
      std::fprintf(stderr, "files of the failed run are in %s\n", directory_.c_str());
    } else {
      daemon_.reset();
      std::filesystem::remove_all(directory_);
    }
  }

  void Start() {
    daemon_.emplace(std::vector<std::string>{FOCALFLEETD, "--config", Path("focalfleet.toml")},
                    Path("daemon.log"));
    ASSERT_TRUE(WaitUntil(
        [&] {
          const auto status = Ask("status", Json::object());
          return status && status->value("phases", Json::object()).value("ready", 0u) == kUnits;
        },
        kPatienceMs));
  }
  Result<Json> Ask(const std::string& verb, const Json& args) {
    auto client = LineClient::Connect(Path("daemon.sock"));
    if (!client) return tl::unexpected<Error>(client.error());
    return client->Call(verb, args, {.silence_max = Seconds(60), .on_progress = {}});
  }
  [[nodiscard]] std::string Targets() const {
    const std::vector<UnitDrive> drives(kUnits);
    const auto poses = DrawConfiguration(layout_, drives, {}, Rng::Stream(1, "targets"));
    std::string csv = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const Unit& unit = layout_.units()[n];
      csv += std::to_string(unit.id.value);
      for (const Axis axis : kAxes)
        csv += "," + std::to_string(AngleDeg((*poses)[n][Index(axis)], unit.axis[Index(axis)],
                                             drives[n].axis[Index(axis)]));
      csv += "\n";
    }
    return csv;
  }
  [[nodiscard]] std::string Path(const std::string& name) const {
    return (directory_ / name).string();
  }
  void Write(const std::string& name, const std::string& text) {
    std::ofstream(Path(name)) << text;
  }

  std::filesystem::path directory_;
  Layout layout_;
  std::optional<Process> daemon_;
};

// The newest orientation of each unit; waits until `enough` of them are there.
std::map<std::uint32_t, UnitOrientationValue> ReadOrientations(StatusReader* reader) {
  std::map<std::uint32_t, UnitOrientationValue> seen;
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  StatusUpdate update;
  while (seen.size() < kUnits && std::chrono::steady_clock::now() < until) {
    EXPECT_TRUE(reader->Wait(std::chrono::milliseconds(100)));
    EXPECT_TRUE(reader->Take(&update));
    EXPECT_EQ(update.malformed, 0u);
    for (const UnitOrientationValue& value : update.orientations) seen[value.unit.value] = value;
  }
  return seen;
}

TEST_F(HallFleet, FiveHundredUnitsMeasureThemselves) {
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
  // Every unit that rests is measured; 4 % slip or are dead, 8.5 % are off scale (sim/spread.h).
  EXPECT_GE(rounds[2].at("measured").get<std::uint32_t>(), 490u);
  EXPECT_GE(rounds[2].at("within_tolerance").get<std::uint32_t>(), 430u);

  const auto reader = StoreReader::Open(Path("fleet.db"));
  ASSERT_TRUE(reader) << reader.error().text;
  const auto rows = (*reader)->Measurements(rounds[2].at("exposure").get<std::uint64_t>());
  ASSERT_TRUE(rows) << rows.error().text;
  ASSERT_EQ(rows->size(), kUnits);
  std::uint32_t stored = 0;
  std::map<std::uint32_t, SpineReading> spine_of;
  for (const auto& [row, at] : *rows) {
    ASSERT_TRUE(row.spine) << row.unit.value;
    EXPECT_EQ(row.source, SightingSource::kSensors);
    spine_of[row.unit.value] = *row.spine;
    if (row.status != SightingStatus::kMeasured) continue;
    ++stored;
    EXPECT_EQ(row.spine->verdict, "ok");
    EXPECT_GT(row.spine->covariance_deg2[0], 0);
    EXPECT_GT(row.covariance.xx * row.covariance.yy, row.covariance.xy * row.covariance.xy);
  }
  EXPECT_GE(stored, 490u);
  const auto fleet = (*reader)->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  const auto by_sensors = std::ranges::count_if(fleet->vectors, [](const VectorRow& row) {
    return row.origin == Origin::kSensors && row.knowledge[0].witness == Witness::kMeasured;
  });
  EXPECT_GE(by_sensors, 490);

  // A reader that joins late gets what the store has.
  StatusReader::Options options;
  options.dds = {OwnDomain(), {}};
  auto joined = StatusReader::Create(options);
  ASSERT_TRUE(joined) << joined.error().text;
  const auto told = ReadOrientations(joined->get());
  ASSERT_EQ(told.size(), kUnits);
  for (const auto& [unit, value] : told) {
    const SpineReading& in_store = spine_of.at(unit);
    EXPECT_EQ(value.spine.verdict, in_store.verdict);
    EXPECT_EQ(value.spine.trusted, in_store.trusted);
    if (!in_store.solved) continue;
    EXPECT_EQ(value.spine.angles_deg, in_store.angles_deg) << unit;
    EXPECT_EQ(value.spine.covariance_deg2, in_store.covariance_deg2) << unit;
  }
  daemon_->Signal(SIGTERM);
  EXPECT_EQ(daemon_->Wait(), 0);
}

}  // namespace
}  // namespace focalfleet::testing
