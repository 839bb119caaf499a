// Phase imbalance: unequal phases or dead time of the bridge.
#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {1, 2, 6}, .shape_name = "motor harmonic", .columns = 2}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  AddHarmonic(track, axis, form.shape * track.unit->gear[axis], amplitude, errors);
}

}  // namespace

Effect MakePhaseImbalance() {
  return {.cause = "phase_imbalance",
          .amplitude_unit = "deg",
          .prior_size = 0.005,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The three phases differ in offset or gain, or the bridge's dead time bends the "
              "voltages: a ripple of one, two or six periods a motor turn, whatever the drive "
              "level.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
