// These tests kill the real daemon (kill -9) at random instants of a configuration while the
// simulated fleet lives on. They also cut the power of units in mid-move. After each restart every
// unit comes to rest, and four facts are checked. The true shaft angle lies in what SQLite holds.
// Only units that lost power are not known. No move began twice. The configuration can be
// completed.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>

#include "daemon/control/line_client.h"
#include "daemon/store/store_reader.h"
#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/state_file.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::Pause;
using test::Process;
using test::ScratchFolder;
using test::TestSeed;
using test::WaitUntil;

// The kills of a run. FOCALFLEET_KILLS overrides the 20, which take about a minute; a nightly run
// has 50.
constexpr int kTrials = 20;
int Trials() {
  const char* kills = std::getenv("FOCALFLEET_KILLS");
  return kills == nullptr ? kTrials : std::atoi(kills);
}
constexpr std::uint32_t kUnits = 60;
constexpr int kSpeed = 30;
// A configuration of this fleet takes 60 to 120 s of its time.
constexpr double kSpanRealMs = 90'000.0 / kSpeed;
constexpr int kPatienceMs = 60'000;
// The rotor rests behind the field by the angle whose sine is load over stall torque: 15 degrees of
// 360, 4 of 96 vectors. The remaining 2 are for rounding; the interval contains the effect of a cut
// motion.
constexpr double kLagVectorsMax = 6;

struct Truth {
  std::array<double, kAxisCount> vectors{};
  std::string state;
  std::uint32_t begun_twice = 0;
};

class Observatory {
 public:
  explicit Observatory(std::uint64_t seed)
      : layout_(*Layout::Create(MakeHexLayout({.count = kUnits, .units_per_bus = 10}), {})),
        drives_(kUnits) {
    folder_.Put("units.csv", WriteUnits(layout_.units()));
    const auto start = DrawConfiguration(layout_, drives_, {}, Rng::Stream(seed, "start"));
    folder_.Put("state.csv",
                WriteState(layout_, drives_,
                           std::vector<std::optional<Pose>>(start->begin(), start->end())));
    // Deadlines are in the fleet's time, but the time that real processes need does not shrink with
    // it.
    folder_.Put(
        "focalfleet.toml",
        "[fleet]\nunits = \"units.csv\"\n[store]\npath = \"fleet.db\"\n"
        "[control]\nsocket = \"daemon.sock\"\n[dds]\nenabled = false\n"
        "[bus]\nport = \"unix\"\nunix_directory = \"" +
            folder_.path() +
            "\"\n"
            "[clock]\nspeed = " +
            std::to_string(kSpeed) +
            ".0\n"
            "[timing]\nreply_wait_ms = 2000\nstart_delay_ms = 3000\nsettle_margin_ms = 2000\n"
            "silence_limit_ms = 30000\npoll_period_ms = 5000\n");
    simulator_.emplace(
        std::vector<std::string>{FOCALFLEET_SIM, "--units", Path("units.csv"), "--state",
                                 Path("state.csv"), "--unix-directory", folder_.path(), "--control",
                                 Path("sim.sock"), "--speed", std::to_string(kSpeed)},
        Path("sim.log"));
    EXPECT_TRUE(
        WaitUntil([&] { return LineClient::Connect(Path("sim.sock")).has_value(); }, kPatienceMs));
  }

  void StartDaemon() {
    daemon_.emplace(std::vector<std::string>{FOCALFLEETD, "--config", Path("focalfleet.toml")},
                    Path("daemon.log"));
    ASSERT_TRUE(WaitUntil(
        [&] {
          const auto status = Ask("status", Json::object());
          return status && status->value("phases", Json::object()).value("ready", 0u) == kUnits;
        },
        kPatienceMs))
        << Ask("status", Json::object()).value_or(Json{}).dump();
  }
  void KillDaemon() {
    daemon_->Signal(SIGKILL);
    EXPECT_EQ(daemon_->Wait(), 128 + SIGKILL);
  }

  Result<Json> Ask(const std::string& verb, const Json& args) {
    return Call("daemon.sock", verb, args);
  }
  Result<Json> AskSimulator(const std::string& verb, const Json& args) {
    return Call("sim.sock", verb, args);
  }

  std::map<std::uint32_t, Truth> TruthOfAll() {
    const auto answer = AskSimulator("truth", Json::object());
    std::map<std::uint32_t, Truth> truth;
    if (!answer) return truth;
    std::istringstream csv((*answer)["csv"].get<std::string>());
    std::string line;
    std::map<std::string, std::size_t> column;
    while (std::getline(csv, line)) {
      if (line.empty() || line[0] == '#') continue;
      std::vector<std::string> cells;
      std::istringstream row(line);
      for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
      if (column.empty()) {
        for (std::size_t n = 0; n < cells.size(); ++n) column[cells[n]] = n;
        continue;
      }
      const auto number = [&](const char* name) { return std::stod(cells.at(column.at(name))); };
      truth[static_cast<std::uint32_t>(number("unit_id"))] = {
          {number("theta_true_vectors"), number("phi_true_vectors")},
          cells.at(column.at("state")),
          static_cast<std::uint32_t>(number("begun_twice"))};
    }
    return truth;
  }

  bool AllAtRest() {
    const auto truth = TruthOfAll();
    return truth.size() == kUnits &&
           std::none_of(truth.begin(), truth.end(), [](const auto& entry) {
             return entry.second.state == "moving" || entry.second.state == "homing";
           });
  }
  /// True when all units rest, have been read anew, and the last batch is durable.
  bool Settled() {
    const auto reader = StoreReader::Open(Path("fleet.db"));
    const auto stored = reader ? (*reader)->Load() : tl::unexpected<Error>(reader.error());
    if (!stored || !stored->open_intents.empty()) return false;
    const auto status = Ask("status", Json::object());
    return status && !status->value("busy", true) &&
           status->value("phases", Json::object()).value("ready", 0u) == kUnits && AllAtRest();
  }

  std::string RandomTargets(std::uint64_t seed) {
    const auto poses = DrawConfiguration(layout_, drives_, {}, Rng::Stream(seed, "targets"));
    std::string csv = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const Unit& unit = layout_.units()[n];
      csv += std::to_string(unit.id.value);
      for (const Axis axis : kAxes)
        csv += "," + std::to_string(AngleDeg((*poses)[n][Index(axis)], unit.axis[Index(axis)],
                                             drives_[n].axis[Index(axis)]));
      csv += "\n";
    }
    return csv;
  }

  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] const Layout& layout() const { return layout_; }

 private:
  Result<Json> Call(const std::string& socket, const std::string& verb, const Json& args) {
    auto client = LineClient::Connect(Path(socket));
    if (!client) return tl::unexpected<Error>(client.error());
    return client->Call(verb, args, {.silence_max = Seconds(60), .on_progress = {}});
  }

  ScratchFolder folder_;  // outlives the processes that write into it
  Layout layout_;
  std::vector<UnitDrive> drives_;
  std::optional<Process> simulator_;
  std::optional<Process> daemon_;
};

// Compares SQLite's record of every unit with the truth. Returns the units whose position is not
// known.
std::set<std::uint32_t> ExpectStoreTellsTheTruth(Observatory* observatory) {
  std::set<std::uint32_t> not_known;
  const auto reader = StoreReader::Open(observatory->Path("fleet.db"));
  EXPECT_TRUE(reader) << (reader ? "" : reader.error().text);
  if (!reader) return not_known;
  const auto stored = (*reader)->Load();
  EXPECT_TRUE(stored) << (stored ? "" : stored.error().text);
  if (!stored) return not_known;
  EXPECT_TRUE(stored->open_intents.empty());
  const auto truth = observatory->TruthOfAll();
  std::map<SerialNumber, UnitId> place;
  for (const auto& unit : stored->units) place[unit.serial] = unit.unit;
  std::size_t seen = 0;
  for (const VectorRow& row : stored->vectors) {
    const std::uint32_t id = place.at(row.serial).value;
    const Truth& is = truth.at(id);
    ++seen;
    EXPECT_EQ(is.begun_twice, 0u) << "unit " << id;
    if (!IsPlace(row.knowledge)) not_known.insert(id);
    for (const Axis axis : kAxes) {
      const AxisKnowledge& known = row.knowledge[Index(axis)];
      if (known.witness == Witness::kUnknown) continue;
      EXPECT_GE(is.vectors[Index(axis)], known.low - kLagVectorsMax)
          << "unit " << id << " " << Name(axis) << " " << Name(known.witness);
      EXPECT_LE(is.vectors[Index(axis)], known.high + kLagVectorsMax)
          << "unit " << id << " " << Name(axis) << " " << Name(known.witness);
    }
  }
  EXPECT_EQ(seen, kUnits);
  return not_known;
}

TEST(Crash, KilledAnywhereTheStoreTellsTheTruthAndTheConfigurationIsCompleted) {
  const std::uint64_t seed = TestSeed(20'261'121);
  FOCALFLEET_TRACE_SEED(seed);
  Observatory observatory(seed);
  observatory.StartDaemon();
  int not_known_total = 0;
  int cut_total = 0;
  int unproven = 0;
  int entangled = 0;
  const int trials = Trials();
  for (int trial = 0; trial < trials; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    Rng rng = Rng::Stream(seed, "trial", static_cast<std::uint64_t>(trial));
    const Json targets{{"source", "trial"}, {"targets_csv", observatory.RandomTargets(rng.Bits())}};
    ASSERT_TRUE(observatory.Ask("apply", targets));

    const bool cuts = rng.Uniform() < 0.5;
    std::set<std::uint32_t> cut;
    if (cuts)
      while (cut.size() < 3) cut.insert(observatory.layout().units()[rng.Below(kUnits)].id.value);
    const Json victims{{"units", cut}, {"seconds", rng.Uniform(5, 60)}};
    const bool cut_before_kill = rng.Uniform() < 0.5;
    Pause(static_cast<int>(rng.Uniform(0, kSpanRealMs)));
    if (cuts && cut_before_kill) {
      ASSERT_TRUE(observatory.AskSimulator("power_cut", victims));
    }
    Pause(static_cast<int>(rng.Uniform(0, 300)));
    observatory.KillDaemon();
    if (cuts && !cut_before_kill) {
      ASSERT_TRUE(observatory.AskSimulator("power_cut", victims));
    }
    Pause(static_cast<int>(rng.Uniform(0, 1500)));

    observatory.StartDaemon();
    ASSERT_TRUE(WaitUntil([&] { return observatory.Settled(); }, kPatienceMs));
    const auto not_known = ExpectStoreTellsTheTruth(&observatory);
    for (const std::uint32_t id : not_known)
      EXPECT_TRUE(cut.contains(id)) << "unit " << id << " did not lose power";
    not_known_total += static_cast<int>(not_known.size());
    cut_total += static_cast<int>(cut.size());

    if (!not_known.empty()) {
      static_cast<void>(observatory.Ask("home", {{"not_known", true}, {"wait", true}}));
      ASSERT_TRUE(WaitUntil([&] { return observatory.Settled(); }, kPatienceMs));
      if (!ExpectStoreTellsTheTruth(&observatory).empty()) {
        // No unit was held back while the daemon was dead, so no way home can be proven; the
        // operator decides.
        ++unproven;
        ASSERT_TRUE(
            observatory.Ask("home", {{"not_known", true}, {"unproven", true}, {"wait", true}}));
        ASSERT_TRUE(WaitUntil([&] { return observatory.Settled(); }, kPatienceMs));
      }
    }
    Json all = targets;
    all["wait"] = true;
    auto completed = observatory.Ask("apply", all);
    ASSERT_TRUE(completed) << completed.error().text;
    if (completed->value("arrived", 0u) != kUnits) {
      // Arms may have got entangled without supervision: units without a way are homed at the
      // operator's command.
      ++entangled;
      std::vector<std::uint32_t> blocked;
      for (const Json& unit : completed->value("unserved", Json::array()))
        blocked.push_back(unit.value("unit_id", 0u));
      ASSERT_TRUE(
          observatory.Ask("home", {{"unit_ids", blocked}, {"unproven", true}, {"wait", true}}));
      completed = observatory.Ask("apply", all);
      ASSERT_TRUE(completed) << completed.error().text;
    }
    EXPECT_EQ(completed->value("arrived", 0u), kUnits) << completed->dump();
    ASSERT_TRUE(WaitUntil([&] { return observatory.Settled(); }, kPatienceMs));
    EXPECT_TRUE(ExpectStoreTellsTheTruth(&observatory).empty());
    if (HasFailure()) break;
  }
  std::printf(
      "%d kills, %d units lost power, %d of them in motion, %d times no way home was proven, "
      "%d times arms were entangled\n",
      trials, cut_total, not_known_total, unproven, entangled);
}

}  // namespace
}  // namespace focalfleet
