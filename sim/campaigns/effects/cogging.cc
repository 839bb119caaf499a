// Cogging: the motor's detent.
#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Forms 1 and 2 are a ripple that falls with the drive or with its square. In form 3 the detent
// turns the rotor so far that the detent there is another one. With sin(lag) = t/U sin(n (angle -
// lag)) the k-th harmonic of the lag falls with U^k.
constexpr int kBent = 3;

void ListCogging(const CampaignFacts&, Templates* out) {
  for (const int power : {1, 2})
    ListGrid({.shapes = {1, 2, 4, 6},
              .shape_name = power == 1 ? "falls with the drive; motor harmonic"
                                       : "falls with its square; motor harmonic",
              .form = power,
              .columns = 2},
             out);
  ListGrid({.shapes = {1, 2, 4, 6},
            .shape_name = "bent, falls with the drive; motor harmonic",
            .form = kBent,
            .columns = 6},
           out);
}

void ApplyCogging(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                  PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const FallsWithDrive falls =
      form.form == kBent ? FallsWithDrive{1, 1} : FallsWithDrive{static_cast<double>(form.form), 0};
  AddMotorWave(track, axis, form.shape * track.unit->gear[axis], falls, amplitude, errors);
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
          .list = ListCogging,
          .apply = ApplyCogging,
          // At one drive level the pull of the poles is a ripple like that of the phases.
          .passes_for = {"phase_imbalance"}};
}

}  // namespace focalfleet::sim
