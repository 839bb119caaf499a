// Phase imbalance: unequal phases or dead time of the bridge.
#include <algorithm>

#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  // Unequal gains grow with the drive, so that the angle does not know it; an offset (order 1) and
  // the bridge's dead time (order 6) are volts of their own.
  ListGrid({.shapes = {2}, .shape_name = "unequal gains; motor harmonic", .columns = 2}, out);
  const bool levels = facts.Has("drive_amplitude");
  ListGrid({.shapes = {1, 6},
            .shape_name = levels ? "falls with the drive; motor harmonic" : "motor harmonic",
            .form = levels ? 1 : 0,
            .columns = 2},
           out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double order = form.shape * track.unit->gear[axis];
  if (form.form == 0) return AddHarmonic(track, axis, order, amplitude, errors);
  const std::span<const double> drive = track.Column("drive_amplitude");
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double phase = HarmonicPhase(track, axis, i, order);
    errors->angle_deg[axis][i] +=
        (amplitude[0] * SineOfTurns(phase) + amplitude[1] * CosineOfTurns(phase)) /
        std::max(drive[i], 0.05);
  }
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
