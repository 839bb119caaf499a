// Classes of axes: what each axis of each unit is like, for those who repair or exclude it. A class
// is read from the angles that the axis turned by, as the camera saw them, against those that it
// was asked. No cause enters: a robust fit of one number for each direction, as observatories keep
// them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

enum class AxisClass {
  kHealthy,
  kScale,     // turns another share of what it is asked, in every move
  kSlipping,  // the same, and long moves stall
  kStuck,     // does not turn
  kWrapped,   // most moves end a whole turn off
  kUnknown,   // too few moves tell
};
std::string_view Name(AxisClass axis_class);

struct AxisReport {
  std::uint32_t unit_id = 0;
  std::size_t axis = kTheta;
  AxisClass is = AxisClass::kUnknown;
  // Angle turned by angle asked, of moves that do not stall: clockwise (falling angles) and
  // counter- clockwise. No value: no such moves.
  std::optional<double> scale_cw, scale_ccw;
  std::size_t stalls = 0;  // long moves that turned nothing
  std::size_t wraps = 0;   // moves that ended a whole turn off
  std::size_t moves = 0;   // moves of the axis whose turn was seen
  std::optional<double> stuck_at_deg;
  double rms_um = 0;  // of the unit, by the geometry of the table; NaN: not seen
};

/// Both axes of all units, theta first. `units`: geometry by which places are turned into angles;
/// the same order as the campaign's.
std::vector<AxisReport> ClassifyAxes(const Campaign& campaign,
                                     const std::vector<CampaignUnit>& units);

/// Axes by class; classes without any are left out.
std::map<std::string, std::size_t> CountByClass(const std::vector<AxisReport>& axes);

}  // namespace focalfleet::sim
