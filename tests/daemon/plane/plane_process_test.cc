// Real daemons: a coordinator and its sectors, each with a simulated fleet of its own, on a DDS
// domain of their own, with and without DDS Security.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/control/line_client.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_reader.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/rng.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

constexpr int kPatienceMs = 120'000;  // limit for a hang; nothing is timed
constexpr std::uint32_t kUnits = 36;
constexpr std::uint32_t kBuses = 6;

class PlaneProcesses : public ::testing::Test {
 protected:
  explicit PlaneProcesses(std::uint32_t sectors = 3, bool secured = false)
      : sectors_(sectors), secured_(secured) {
    std::vector<Unit> units = MakeHexLayout({.count = kUnits, .units_per_bus = 6});
    std::ranges::sort(units, {}, [](const Unit& unit) { return unit.base_fp.x_mm; });
    for (std::uint32_t n = 0; n < units.size(); ++n) {
      units[n].bus = {n / 6};
      units[n].node = {static_cast<std::uint8_t>(n % 6 + 1)};
    }
    std::ofstream(scratch_ / "units.csv") << WriteUnits(units);
    layout_ = std::make_unique<Layout>(std::move(*Layout::Create(units, {})));
    if (secured) MakeKeys();
    std::string list;
    for (std::uint32_t n = 0; n < sectors; ++n)
      list += (list.empty() ? "\"" : ", \"") + Buses(n) + "\"";
    Configure("plane", "coordinator", "[plane]\nsectors = [" + list + "]\n");
    for (std::uint32_t n = 0; n < sectors; ++n)
      Configure(Name(n), "sector-" + std::to_string(n),
                "[sector]\nnumber = " + std::to_string(n) + "\nbuses = \"" + Buses(n) + "\"\n");
    Start("plane");
    for (std::uint32_t n = 0; n < sectors; ++n) Start(Name(n));
  }
  [[nodiscard]] std::string Buses(std::uint32_t sector) const {
    const std::uint32_t each = kBuses / sectors_;
    return std::to_string(sector * each) + "-" + std::to_string((sector + 1) * each - 1);
  }
  void MakeKeys(const std::string& options = {}) const {
    const std::string command = MAKE_KEYS " " + Keys("") + " --domain " +
                                std::to_string(test::OwnDomain()) + " --sectors " +
                                std::to_string(sectors_) + " " + options + " > /dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
  }
  [[nodiscard]] std::string Keys(const std::string& who) const {
    return scratch_ / ("keys/" + who);
  }
  static std::string Name(std::uint32_t sector) { return "s" + std::to_string(sector); }
  void Configure(const std::string& name, const std::string& who, const std::string& role) const {
    std::ofstream(scratch_ / (name + ".toml"))
        << "[store]\npath = \"" << name << ".db\"\n[control]\nsocket = \"" << name
        << ".sock\"\n[dds]\ndomain = " << test::OwnDomain()
        << (secured_ ? "\nsecurity = \"" + Keys(who) + "\"" : std::string())
        << "\n[clock]\nspeed = 4.0\n[bus]\nport = \"simulated\"\n[journal]\nlimit_MiB = 0\n"
        << role;
  }
  void Start(const std::string& name) {
    processes_[name] = std::make_unique<test::Process>(
        std::vector<std::string>{FOCALFLEETD, "--config", scratch_ / (name + ".toml")},
        scratch_ / (name + ".log"));
  }
  void Kill(const std::string& name) {
    processes_[name]->Signal(SIGKILL);
    static_cast<void>(processes_[name]->Wait());
  }
  [[nodiscard]] Result<Json> Ask(const std::string& name, const std::string& verb,
                                 const Json& args = Json::object()) const {
    FOCALFLEET_TRY_ASSIGN(LineClient client, LineClient::Connect(scratch_ / (name + ".sock")));
    return client.Call(verb, args, {.silence_max = Seconds(120), .on_progress = {}});
  }
  [[nodiscard]] bool Stands() const {
    return test::WaitUntil(
        [&] {
          const auto status = Ask("plane", "status");
          if (!status || (*status)["plane"]["phase"] != "idle") return false;
          for (std::uint32_t n = 0; n < sectors_; ++n) {
            if ((*status)["plane"]["sectors"][n]["trouble"] != "") return false;
            const auto sector = Ask(Name(n), "status");
            if (!sector || (*sector)["phases"]["ready"] != kUnits / sectors_) return false;
          }
          return true;
        },
        kPatienceMs);
  }
  /// The configuration that is under way, if any, comes to its end.
  [[nodiscard]] bool Ends() const {
    return test::WaitUntil(
        [&] {
          const auto status = Ask("plane", "status");
          return status && (*status)["busy"] == false;
        },
        kPatienceMs);
  }
  [[nodiscard]] std::string Log(const std::string& name) const {
    std::ifstream file(scratch_ / (name + ".log"));
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  [[nodiscard]] std::string Logs() const {
    std::string all = "plane: " + Log("plane");
    for (std::uint32_t n = 0; n < sectors_; ++n) all += "\n" + Name(n) + ": " + Log(Name(n));
    return all;
  }
  /// Targets for all units, as a file.
  [[nodiscard]] std::string Targets(std::uint64_t seed) const {
    const std::vector<UnitDrive> drives(layout_->size());
    const auto poses = DrawConfiguration(*layout_, drives, {}, Rng::Stream(seed, "targets"));
    std::string text = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < layout_->size(); ++n) {
      const Unit& unit = layout_->units()[n];
      text += std::to_string(unit.id.value);
      for (const Axis axis : kAxes)
        text += "," + std::to_string(AngleDeg((*poses)[n][Index(axis)], unit.axis[Index(axis)],
                                              drives[n].axis[Index(axis)]));
      text += "\n";
    }
    return text;
  }

  /// A reader of the whole plane, until `done` with what came so far, or for long.
  struct Seen {
    std::set<std::uint32_t> units;
    std::set<std::optional<std::uint32_t>> daemons;
  };
  static Seen Watch(const std::string& security, const std::function<bool(const Seen&)>& done,
                    int patience_ms = kPatienceMs) {
    Seen seen;
    auto reader = StatusReader::Create(
        {.dds = {.domain = test::OwnDomain(), .config_xml = {}, .security = security},
         .units = true,
         .partitions = AllPartitions()});
    if (!reader) {
      ADD_FAILURE() << reader.error().text;
      return seen;
    }
    static_cast<void>(test::WaitUntil(
        [&] {
          StatusUpdate update;
          EXPECT_TRUE((*reader)->Take(&update));
          for (const UnitStatusValue& unit : update.units) seen.units.insert(unit.unit.value);
          for (const FleetStatusValue& fleet : update.fleets) seen.daemons.insert(fleet.sector);
          return done(seen);
        },
        patience_ms));
    return seen;
  }

  const std::uint32_t sectors_;
  const bool secured_;
  const test::ScratchFolder scratch_;
  std::unique_ptr<Layout> layout_;
  std::map<std::string, std::unique_ptr<test::Process>> processes_;
};

TEST_F(PlaneProcesses, CarryOutAConfigurationAndGoOnAfterKills) {
  ASSERT_TRUE(Stands()) << Logs();
  // A sector does not move on its own.
  const auto refused = Ask("s0", "apply", {{"source", "t"}, {"targets_csv", Targets(1)}});
  ASSERT_FALSE(refused.has_value());
  const auto first =
      Ask("plane", "apply", {{"source", "first"}, {"targets_csv", Targets(1)}, {"wait", true}});
  ASSERT_TRUE(first.has_value()) << first.error().text << Logs();
  EXPECT_EQ((*first)["state"], "done") << *first << Logs();
  EXPECT_EQ((*first)["arrived"], kUnits) << *first << Logs();
  // The coordinator is killed in motion, and its next life goes on.
  const auto second =
      Ask("plane", "apply", {{"source", "second"}, {"targets_csv", Targets(2)}, {"wait", false}});
  ASSERT_TRUE(second.has_value()) << second.error().text;
  ASSERT_TRUE(test::WaitUntil(
      [&] {
        const auto status = Ask("plane", "status");
        return status && (*status)["configuration"]["state"] == "moving";
      },
      kPatienceMs))
      << Logs();
  Kill("plane");
  Start("plane");
  ASSERT_TRUE(Stands()) << Logs();
  auto status = Ask("plane", "status");
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ((*status)["configuration"]["arrived"], kUnits) << *status << Logs();
  EXPECT_EQ((*status)["plane"]["epoch"], 2);
  // A sector ends, and the plane works with the others.
  Kill("s2");
  const auto third =
      Ask("plane", "apply", {{"source", "third"}, {"targets_csv", Targets(3)}, {"wait", true}});
  ASSERT_TRUE(third.has_value()) << third.error().text << Logs();
  EXPECT_GT((*third)["arrived"], 0) << *third;
  EXPECT_GT((*third)["refused"], 0) << "units beside the sector that is not there stand";
  EXPECT_EQ((*third)["left_out"], kUnits / sectors_) << *third;
}

TEST_F(PlaneProcesses, ShowTheWholePlane) {
  ASSERT_TRUE(Stands()) << Logs();
  // A single reader has all units, and each daemon's own status beside the coordinator's.
  const auto whole = [this](const Seen& seen) {
    return seen.units.size() == kUnits && seen.daemons.size() == sectors_ + 1;
  };
  const Seen seen = Watch({}, whole);
  EXPECT_EQ(seen.units.size(), kUnits);
  EXPECT_TRUE(seen.daemons.contains(std::nullopt));
  EXPECT_TRUE(seen.daemons.contains(sectors_ - 1));
  // The coordinator's own table has them, too.
  const auto rows_with = [this](const char* phase, bool silent) {
    std::size_t count = 0;
    if (const auto state = Ask("plane", "state"))
      for (const Json& row : (*state)["rows"])
        count += row["phase"] == phase && row["silent"] == silent ? 1u : 0u;
    return count;
  };
  EXPECT_TRUE(test::WaitUntil([&] { return rows_with("ready", false) == kUnits; }, kPatienceMs))
      << Logs();
  const auto unit = Ask("plane", "unit", {{"unit_id", layout_->units().back().id.value}});
  ASSERT_FALSE(unit.has_value());
  EXPECT_NE(unit.error().text.find("s2.sock"), std::string::npos) << unit.error().text;
  const auto alarms = Ask("plane", "alarms");
  ASSERT_TRUE(alarms.has_value()) << alarms.error().text;
  EXPECT_EQ((*alarms)["open"], 0) << *alarms;
  // A sector that ended is said to be silent, and none of its units has a place.
  Kill("s2");
  EXPECT_TRUE(
      test::WaitUntil([&] { return rows_with("silent", true) == kUnits / sectors_; }, kPatienceMs))
      << Logs();
  EXPECT_EQ(rows_with("ready", false), kUnits - kUnits / sectors_);
}

TEST_F(PlaneProcesses, HomeAndGiveOtherTargets) {
  ASSERT_TRUE(Stands()) << Logs();
  // A unit at the border of sectors 0 and 1: they are strips across x, of two buses each.
  const std::uint32_t id = layout_->units()[11].id.value;
  const auto refused = Ask("s0", "home", {{"unit_ids", {id}}});
  ASSERT_FALSE(refused.has_value());
  const auto unknown = Ask("plane", "home", {{"unit_ids", {id, 4711}}});
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().text, "there is no unit 4711");
  const auto homed = Ask("plane", "home", {{"unit_ids", {id}}, {"wait", true}});
  ASSERT_TRUE(homed.has_value()) << homed.error().text << Logs();
  EXPECT_EQ((*homed)["kind"], "home");
  EXPECT_EQ((*homed)["arrived"], 1) << *homed << Logs();
  // Nobody but the daemon's own doors may name another caller.
  auto client = LineClient::Connect(scratch_ / "plane.sock");
  ASSERT_TRUE(client.has_value());
  const auto forged =
      client->Call("access", Json::object(),
                   {.silence_max = Seconds(120),
                    .on_progress = {},
                    .caller = Caller{.role = Role::kEngineer, .door = Door::kHttp, .token = "t"}});
  ASSERT_FALSE(forged.has_value());
  EXPECT_EQ(forged.error().text, "only the daemon itself asks on behalf of others");
  const auto none = Ask("plane", "retarget", {{"unit_id", id}, {"theta_deg", 10}, {"phi_deg", 90}});
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().text, "no configuration is under way: apply one");
  ASSERT_TRUE(
      Ask("plane", "apply", {{"source", "t"}, {"targets_csv", Targets(5)}, {"wait", false}}));
  const auto other =
      Ask("plane", "retarget", {{"unit_id", id}, {"theta_deg", 20}, {"phi_deg", 150}});
  ASSERT_TRUE(other.has_value()) << other.error().text << Logs();
  EXPECT_EQ((*other)["goes"], true) << *other;
  ASSERT_TRUE(Ends()) << Logs();
  const auto unit = Ask("s0", "unit", {{"unit_id", id}});
  ASSERT_TRUE(unit.has_value()) << unit.error().text;
  const PointFp aim = FibreAt(layout_->units()[11], AxisAngles{20, 150});
  EXPECT_NEAR((*unit)["target"]["x_mm"].get<double>(), aim.x_mm, 0.01) << *unit;
  EXPECT_NEAR((*unit)["target"]["y_mm"].get<double>(), aim.y_mm, 0.01) << *unit;
}

class SecuredPlane : public PlaneProcesses {
 protected:
  SecuredPlane() : PlaneProcesses(2, true) {}
};

// Credentials of make-keys let each daemon of a plane do its part, and no more.
TEST_F(SecuredPlane, WorksAndShowsItselfToMonitorsAlone) {
  ASSERT_TRUE(Stands()) << Logs();
  const auto done =
      Ask("plane", "apply", {{"source", "t"}, {"targets_csv", Targets(1)}, {"wait", true}});
  ASSERT_TRUE(done.has_value()) << done.error().text << Logs();
  EXPECT_EQ((*done)["arrived"], kUnits) << *done << Logs();
  const auto whole = [](const Seen& seen) {
    return seen.units.size() == kUnits && seen.daemons.size() == 3;
  };
  const Seen seen = Watch(Keys("monitor"), whole);
  EXPECT_EQ(seen.units.size(), kUnits);
  EXPECT_EQ(seen.daemons.size(), 3u);
  // A reader without credentials gets nothing in the time in which a monitor has everything.
  const Seen nothing = Watch(
      {}, [](const Seen&) { return false; }, 8000);
  EXPECT_TRUE(nothing.units.empty());
  EXPECT_TRUE(nothing.daemons.empty());
  // A sector cannot speak as another one, nor as a coordinator.
  const auto publish_as = [this](const char* who, const char* partition) {
    return StatusPublisher::Create({.domain = test::OwnDomain(),
                                    .config_xml = {},
                                    .security = Keys(who),
                                    .partition = partition})
        .has_value();
  };
  EXPECT_TRUE(publish_as("sector-1", "sector-1"));
  EXPECT_FALSE(publish_as("sector-1", "sector-0"));
  EXPECT_FALSE(publish_as("sector-1", "plane"));
  EXPECT_FALSE(publish_as("sector-1", ""));
  EXPECT_TRUE(publish_as("coordinator", "plane"));
  EXPECT_FALSE(publish_as("coordinator", "sector-0"));
  EXPECT_FALSE(publish_as("monitor", "plane"));
}

/// Credentials that end soon.
class ShortlySecuredPlane : public PlaneProcesses {
 protected:
  static constexpr const char* kSeconds = "75";
  ShortlySecuredPlane() : PlaneProcesses(2, (setenv("MAKE_KEYS_SECONDS", kSeconds, 1), true)) {
    unsetenv("MAKE_KEYS_SECONDS");
  }
  ~ShortlySecuredPlane() override { unsetenv("MAKE_KEYS_SECONDS"); }
  const std::chrono::steady_clock::time_point ended_ =
      std::chrono::steady_clock::now() + std::chrono::seconds(76);
};

TEST_F(ShortlySecuredPlane, TakesNewCredentialsWithoutARestart) {
  ASSERT_TRUE(Stands()) << Logs();
  for (const char* who : {"coordinator:coordinator", "sector:sector-0", "sector:sector-1"})
    MakeKeys(std::string("--only ") + who);
  // Those with which the daemons have begun are over.
  ASSERT_TRUE(
      test::WaitUntil([this] { return std::chrono::steady_clock::now() > ended_; }, kPatienceMs));
  ASSERT_TRUE(Stands()) << Logs();
  const auto done =
      Ask("plane", "apply", {{"source", "t"}, {"targets_csv", Targets(1)}, {"wait", true}});
  ASSERT_TRUE(done.has_value()) << done.error().text << Logs();
  EXPECT_EQ((*done)["arrived"], kUnits) << *done << Logs();
  std::size_t ready = 0;
  ASSERT_TRUE(test::WaitUntil(
      [&] {
        ready = 0;
        if (const auto state = Ask("plane", "state"))
          for (const Json& row : (*state)["rows"]) ready += row["silent"] == false ? 1u : 0u;
        return ready == kUnits;
      },
      kPatienceMs))
      << ready << Logs();
}

TEST_F(PlaneProcesses, StopInAllSectors) {
  ASSERT_TRUE(Stands()) << Logs();
  ASSERT_TRUE(
      Ask("plane", "apply", {{"source", "t"}, {"targets_csv", Targets(4)}, {"wait", false}}));
  ASSERT_TRUE(test::WaitUntil(
      [&] {
        const auto sector = Ask("s1", "status");
        return sector && (*sector)["phases"].value("moving", 0) > 0;
      },
      kPatienceMs))
      << Logs();
  ASSERT_TRUE(Ask("plane", "stop").has_value());
  ASSERT_TRUE(Ends()) << Logs();
  const auto status = Ask("plane", "status");
  EXPECT_EQ((*status)["configuration"]["state"], "stopped") << *status << Logs();
  EXPECT_GT((*status)["configuration"]["stopped"], 0) << *status;
}

}  // namespace
}  // namespace focalfleet
