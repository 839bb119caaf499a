// What a campaign collects while it runs: after each move, where the coordinator believed every
// unit before and after, and where the camera saw it. Becomes the folder of docs/files.md.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "fleet/kinematics.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"
#include "sim/campaign/campaign.h"

namespace focalfleet {

/// One unit in one move. Angles in degrees of the axes as the unit counts them.
struct LoggedMove {
  UnitId unit;
  std::int64_t move = 0;
  AxisAngles from;
  AxisAngles to;
  double x_mm = 0;  // NaN: not seen, or not certain
  double y_mm = 0;
  double sigma_um = 0;  // NaN likewise
  double t_s = 0;       // of the exposure, since the first
};

/// What holds for all moves of the campaign.
struct CampaignConditions {
  double v_bus_V = 0;
  std::array<double, kAxisCount> counter1{};
  double repeat = 0;
  std::string mode;
};

class CampaignLog {
 public:
  CampaignLog(const Layout* layout, CampaignConditions conditions)
      : layout_(layout), conditions_(std::move(conditions)) {}

  /// All units of one move, those too that stayed.
  void Add(const std::vector<LoggedMove>& units);
  /// Covariates that follow from the log: t_s, sigma_um, rail_id, bus_id, slots, movers_on_rail,
  /// drive_amplitude, counter1, repeat, v_bus_V, mode, revolutions made.
  [[nodiscard]] sim::Campaign Campaign(const std::string& name) const;

 private:
  const Layout* layout_;
  CampaignConditions conditions_;
  std::map<std::uint32_t, std::vector<LoggedMove>> of_unit_;                // by id
  std::map<std::pair<std::int64_t, std::uint32_t>, std::uint32_t> movers_;  // move, rail
};

}  // namespace focalfleet
