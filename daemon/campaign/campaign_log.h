// CampaignLog collects the moves of a campaign while it runs. For each unit and move it keeps where
// the coordinator believed the unit before and after, and where the camera measured it. The log
// becomes the folder of docs/files.md.
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

/// A unit in one move. Angles are in degrees of the axes, as the unit counts them.
struct LoggedMove {
  UnitId unit;
  std::int64_t move = 0;
  AxisAngles from;
  AxisAngles to;
  double x_mm = 0;  // NaN: not seen, or not certain
  double y_mm = 0;
  double sigma_um = 0;  // NaN likewise
  double t_s = 0;       // of the exposure, since the first exposure
  double delay_s = 0;   // from the end of its motion to the exposure; NaN: not known
  // Drive parameters of the unit.
  double v_bus_V = 0;
  double counter1 = 0;
  double repeat = 0;
  std::string mode;
  SerialNumber serial = {};  // of the hardware that made the move; 0: not known
};

/// A unit of the layout, in the form that campaigns use.
sim::CampaignUnit DescribeUnit(const Unit& unit);

class CampaignLog {
 public:
  explicit CampaignLog(const Layout* layout) : layout_(layout) {}

  /// Adds one move. Pre: `units` holds all units, those that stayed too.
  void Add(const std::vector<LoggedMove>& units);
  /// The campaign collected so far. Its covariates are all of docs/files.md except three: the
  /// daemon does not receive `temp_C` and `elevation_deg`, and no move of a campaign is `rehomed`.
  /// Units are driven at the tuned level, so drive_amplitude is 1.
  [[nodiscard]] sim::Campaign Campaign(const std::string& name) const;

 private:
  const Layout* layout_;
  std::map<std::uint32_t, std::vector<LoggedMove>> of_unit_;                // by unit id
  std::map<std::pair<std::int64_t, std::uint32_t>, std::uint32_t> movers_;  // by move and rail
};

}  // namespace focalfleet
