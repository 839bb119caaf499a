// Cogging: the motor's detent.
#include <algorithm>

#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  for (const int power : {1, 2})
    ListGrid({.shapes = {1, 2, 6},
              .shape_name = power == 1 ? "falls with the drive; motor harmonic"
                                       : "falls with its square; motor harmonic",
              .form = power,
              .columns = 2},
             out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> drive = track.Column("drive_amplitude");
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double level = std::max(drive[i], 0.05);
    const double strength = form.form == 1 ? 1 / level : 1 / (level * level);
    const double phase = HarmonicPhase(track, axis, i, form.shape * track.unit->gear[axis]);
    errors->angle_deg[axis][i] +=
        strength * (amplitude[0] * SineOfTurns(phase) + amplitude[1] * CosineOfTurns(phase));
  }
}

}  // namespace

Effect MakeCogging() {
  return {.cause = "cogging",
          .amplitude_unit = "deg",
          .prior_size = 0.005,
          .owner = Owner::kUnit,
          .needs = {"drive_amplitude"},
          .paragraph =
              "The rotor prefers certain angles; the weaker the drive, the more. A ripple "
              "with the motor's own order that falls with the drive level. A stronger hold at "
              "the end of the move removes it.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
