// A fleet for which the planner needs a minute: the arms reach far into their neighbours' cells,
// and the way leads from one random configuration to another. The planner abandons units by ones
// and twos.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "daemon/control/line_client.h"
#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/rng.h"
#include "protocol/wire/messages.h"

namespace focalfleet::test {

class CrowdedFleet {
 public:
  static constexpr std::uint32_t kUnits = 300;

  /// `folder`, ending in a slash, has the fleet's units.csv. The daemon's control socket is there,
  /// too.
  explicit CrowdedFleet(std::string folder)
      : folder_(std::move(folder)),
        layout_(Layout::Create(
                    MakeHexLayout(
                        {.count = kUnits, .pitch_mm = 14, .theta_arm_mm = 9, .phi_arm_mm = 10}),
                    {})
                    .value()) {
    std::vector<Unit> units;
    for (std::uint32_t n = 0; n < kUnits; ++n) units.push_back(layout_.unit({n}));
    std::ofstream(folder_ + "units.csv") << WriteUnits(units);
  }
  /// Targets at a random configuration.
  [[nodiscard]] std::string Targets(std::uint64_t seed) const {
    const std::vector<Pose> poses = Draw(seed);
    std::string targets = "unit_id,theta_deg,phi_deg\n";
    for (std::uint32_t n = 0; n < kUnits; ++n) {
      const AxisAngles angles = AnglesOf(layout_.unit({n}), drives_[n], poses[n]);
      targets += std::to_string(layout_.unit({n}).id.value) + "," +
                 std::to_string(angles.theta_deg) + "," + std::to_string(angles.phi_deg) + "\n";
    }
    return targets;
  }
  /// The daemon takes each unit to stand at a random configuration. Pre: all units are ready.
  void StandAt(std::uint64_t seed) const {
    const std::vector<Pose> poses = Draw(seed);
    auto client = LineClient::Connect(folder_ + "control.sock");
    ASSERT_TRUE(client);
    for (std::uint32_t n = 0; n < kUnits; ++n)
      for (const Axis axis : kAxes) {
        const auto done = client->Call("params_set", {{"unit_id", layout_.unit({n}).id.value},
                                                      {"axis", Name(axis)},
                                                      {"parameter", Name(Parameter::kPosition)},
                                                      {"value", poses[n][Index(axis)]}});
        ASSERT_TRUE(done) << done.error().text;
      }
  }

 private:
  [[nodiscard]] std::vector<Pose> Draw(std::uint64_t seed) const {
    return DrawConfiguration(layout_, drives_, std::vector<std::optional<Pose>>(kUnits),
                             Rng::Stream(seed, "configuration"))
        .value();
  }

  std::string folder_;
  Layout layout_;
  std::vector<UnitDrive> drives_ = std::vector<UnitDrive>(kUnits);
};

}  // namespace focalfleet::test
