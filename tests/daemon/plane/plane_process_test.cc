// Real daemons: a coordinator and three sectors, each with a simulated fleet of its own, on a DDS
// domain of their own.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/control/line_client.h"
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
constexpr std::uint32_t kSectors = 3;
constexpr std::uint32_t kUnits = 36;

class PlaneProcesses : public ::testing::Test {
 protected:
  PlaneProcesses() {
    std::vector<Unit> units = MakeHexLayout({.count = kUnits, .units_per_bus = 6});
    std::ranges::sort(units, {}, [](const Unit& unit) { return unit.base_fp.x_mm; });
    for (std::uint32_t n = 0; n < units.size(); ++n) {
      units[n].bus = {n / 6};
      units[n].node = {static_cast<std::uint8_t>(n % 6 + 1)};
    }
    std::ofstream(scratch_ / "units.csv") << WriteUnits(units);
    layout_ = std::make_unique<Layout>(std::move(*Layout::Create(units, {})));
    Configure("plane", "[plane]\nsectors = [\"0-1\", \"2-3\", \"4-5\"]\n");
    for (std::uint32_t n = 0; n < kSectors; ++n)
      Configure(Name(n), "[sector]\nnumber = " + std::to_string(n) + "\nbuses = \"" +
                             std::to_string(2 * n) + "-" + std::to_string(2 * n + 1) + "\"\n");
    Start("plane");
    for (std::uint32_t n = 0; n < kSectors; ++n) Start(Name(n));
  }
  static std::string Name(std::uint32_t sector) { return "s" + std::to_string(sector); }
  void Configure(const std::string& name, const std::string& role) const {
    std::ofstream(scratch_ / (name + ".toml"))
        << "[store]\npath = \"" << name << ".db\"\n[control]\nsocket = \"" << name
        << ".sock\"\n[dds]\ndomain = " << test::OwnDomain()
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
          for (std::uint32_t n = 0; n < kSectors; ++n) {
            if ((*status)["plane"]["sectors"][n]["trouble"] != "") return false;
            const auto sector = Ask(Name(n), "status");
            if (!sector || (*sector)["phases"]["ready"] != kUnits / kSectors) return false;
          }
          return true;
        },
        kPatienceMs);
  }
  [[nodiscard]] std::string Log(const std::string& name) const {
    std::ifstream file(scratch_ / (name + ".log"));
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  [[nodiscard]] std::string Logs() const {
    std::string all = "plane: " + Log("plane");
    for (std::uint32_t n = 0; n < kSectors; ++n) all += "\n" + Name(n) + ": " + Log(Name(n));
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
  EXPECT_EQ((*third)["left_out"], kUnits / kSectors) << *third;
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
  ASSERT_TRUE(test::WaitUntil(
      [&] {
        const auto status = Ask("plane", "status");
        return status && (*status)["busy"] == false;
      },
      kPatienceMs))
      << Logs();
  const auto status = Ask("plane", "status");
  EXPECT_EQ((*status)["configuration"]["state"], "stopped") << *status << Logs();
  EXPECT_GT((*status)["configuration"]["stopped"], 0) << *status;
}

}  // namespace
}  // namespace focalfleet
