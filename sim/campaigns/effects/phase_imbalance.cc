// Phase imbalance: unequal phases or dead time of the bridge.
#include <utility>
#include <vector>

#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// The fall with the drive, by form. Form 0 is gains; form 1 is volts, an offset or dead time. In
// the others the field is turned so far that its angle is no sine. Form 2 is gains, an ellipse.
// Form 3 is an offset, whose k-th harmonic falls with U^k. Form 4 is dead time, which has corners.
constexpr FallsWithDrive kFalls[] = {{0, 0}, {1, 0}, {0, 0}, {1, 1}, {1, 0}};
constexpr bool IsBent(int form) { return form >= 2; }

void ListPhaseImbalance(const CampaignFacts& facts, Templates* out) {
  const auto list = [&](int form, std::vector<double> harmonics, const char* name) {
    ListGrid({.shapes = std::move(harmonics),
              .shape_name = name,
              .form = form,
              .columns = IsBent(form) ? 6u : 2u},
             out);
  };
  // Unequal gains grow with the drive, so that the angle does not depend on it. An offset (order 1)
  // and the bridge's dead time (order 6) are fixed voltages.
  list(0, {2}, "unequal gains; motor harmonic");
  list(2, {2}, "bent, unequal gains; motor harmonic");
  if (!facts.Has("drive_amplitude")) {
    list(0, {1, 6}, "motor harmonic");
    list(2, {1, 6}, "bent; motor harmonic");
    return;
  }
  list(1, {1, 6}, "falls with the drive; motor harmonic");
  list(3, {1}, "bent, falls with the drive; motor harmonic");
  list(4, {6}, "bent, falls with the drive; motor harmonic");
}

void ApplyPhaseImbalance(const UnitTrack& track, const Template& form,
                         std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  AddMotorWave(track, axis, form.shape * track.unit->gear[axis], kFalls[form.form], amplitude,
               errors);
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
              "voltages: a ripple of one, two or six periods a motor turn. That of gains does not "
              "know the drive level, the others fall with it.",
          .list = ListPhaseImbalance,
          .apply = ApplyPhaseImbalance};
}

}  // namespace focalfleet::sim
