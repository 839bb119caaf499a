// Fibre torque: the fibre's spring turns the arm.
#include <algorithm>
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr double kLinear = 0.3, kFriction = 0.2;  // shares beside the cubic term

void ListFibreTorque(const CampaignFacts&, Templates* out) {
  ListGrid({}, out);
  ListGrid({.form = 1}, out);
  ListGrid({.form = 2}, out);
  // A stiffening spring, and the fibre bundle's own friction over a travel.
  ListGrid({.shapes = {6, 18, 50}, .shape_name = "with a loop over a travel of, deg,", .form = 3},
           out);
}

void ApplyFibreTorque(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const CampaignUnit& unit = *track.unit;
  const double middle_deg = (unit.min_deg[axis] + unit.max_deg[axis]) / 2;
  const double half_deg = std::max((unit.max_deg[axis] - unit.min_deg[axis]) / 2, 1.0);
  double direction = 0, loop = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double turned = (track.cmd_deg[axis][i] - middle_deg) / half_deg;
    if (track.restarts[i]) direction = 0, loop = 0;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    loop = direction - (direction - loop) * std::exp(-std::abs(track.step_deg[axis][i]) /
                                                     std::max(form.shape, 1e-3));
    // Form 0 is a spring that stiffens towards both ends, form 1 stiffens by the square, form 2 is
    // the hysteresis of the way back. Form 3 is a stiffening spring with some friction.
    double pull = turned * turned * turned;
    if (form.form == 1) pull = turned * std::abs(turned);
    if (form.form == 2) pull = std::abs(turned) * direction;
    if (form.form == 3) pull += kLinear * turned + kFriction * loop;
    errors->angle_deg[axis][i] -= amplitude[0] * pull;
  }
}

}  // namespace

Effect MakeFibreTorque() {
  return {.cause = "fibre_torque",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The twisted fibre pulls the axis back, the more the farther it is turned, and "
              "not quite the same on the way back. Re-route the fibre or limit the range.",
          .list = ListFibreTorque,
          .apply = ApplyFibreTorque,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          .distortions = kOfMoves};
}

}  // namespace focalfleet::sim
