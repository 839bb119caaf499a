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
#include "sim/campaigns/campaign/campaign.h"

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
  double delay_s = 0;   // end of its motion to the exposure; NaN: not known
  // How it is driven.
  double v_bus_V = 0;
  double counter1 = 0;
  double repeat = 0;
  std::string mode;
  SerialNumber serial = {};  // that made the move; 0: not known
};

/// What the layout says of a unit, as campaigns have it.
sim::CampaignUnit DescribeUnit(const Unit& unit);

class CampaignLog {
 public:
  explicit CampaignLog(const Layout* layout) : layout_(layout) {}

  /// All units of one move, those too that stayed.
  void Add(const std::vector<LoggedMove>& units);
  /// Covariates: all of docs/files.md but `temp_C` and `elevation_deg`, which nobody tells us, and
  /// `rehomed`, which no move of a campaign is. Units are driven at the tuned level:
  /// drive_amplitude is 1.
  [[nodiscard]] sim::Campaign Campaign(const std::string& name) const;

 private:
  const Layout* layout_;
  std::map<std::uint32_t, std::vector<LoggedMove>> of_unit_;                // by id
  std::map<std::pair<std::int64_t, std::uint32_t>, std::uint32_t> movers_;  // move, rail
};

}  // namespace focalfleet
