// Hard stop: the axis runs into its end before the limit of units.csv.
#include <algorithm>
#include <vector>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListHardStop(const CampaignFacts&, Templates* out) {
  const std::vector<double> begins_deg = {1, 2, 4, 7, 10, 13, 16, 20, 25, 32, 40};
  ListGrid({.shapes = begins_deg, .shape_name = "upper end; begins before it by, deg,"}, out);
  ListGrid({.shapes = begins_deg, .shape_name = "lower end; begins before it by, deg,", .form = 1},
           out);
  // The motor runs on against the stop, and is out of step until the unit is homed.
  ListGrid({.shapes = begins_deg, .shape_name = "upper end; slips from, deg before it,", .form = 2},
           out);
  ListGrid({.shapes = begins_deg, .shape_name = "lower end; slips from, deg before it,", .form = 3},
           out);
}

void ApplyHardStop(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                   PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const CampaignUnit& unit = *track.unit;
  const bool upper = form.form == 0 || form.form == 2, slips = form.form >= 2;
  double lost_deg = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i] || track.IsBeginning(i)) lost_deg = 0;
    const double q = track.cmd_deg[axis][i] + lost_deg;
    const double beyond_deg = upper ? -std::max(q - (unit.max_deg[axis] - form.shape), 0.0)
                                    : std::max(unit.min_deg[axis] + form.shape - q, 0.0);
    if (slips) lost_deg += beyond_deg;
    errors->angle_deg[axis][i] += amplitude[0] * (slips ? lost_deg : beyond_deg);
  }
}

}  // namespace

Effect MakeHardStop() {
  return {.cause = "hard_stop",
          .amplitude_unit = "deg/deg",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Near an end of its range the axis is held back: the stop, or the clearance "
              "before it, begins earlier than the table says. Narrow the range of this unit.",
          .list = ListHardStop,
          .apply = ApplyHardStop,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          // A stop holds an axis back and never pulls. At 1 the axis stands still there; more is
          // for a stop between two of the listed places.
          .amplitude_low = 0,
          .amplitude_high = 1.5};
}

}  // namespace focalfleet::sim
