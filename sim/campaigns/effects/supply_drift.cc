// Supply drift: the voltage falls over the campaign.
#include <algorithm>

#include "sim/campaigns/effects/load_angle.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListSupplyDrift(const CampaignFacts& facts, Templates* out) {
  const FilledColumn* volts = facts.Find("v_bus_V");
  const std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi, EffectAxis::kBoth};
  ListGrid({.axes = axes, .shapes = {volts->high, volts->mean}, .shape_name = "below, V,"}, out);
  // A rotor under load: the lag is an arcsine, and depends on the drive. The lag at the usual
  // voltage is subtracted.
  ListGrid({.axes = axes,
            .shapes = {0.2, 0.4, 0.6, 0.75, 0.85, 0.92},
            .shape_name = "load, of the pull-out,",
            .form = 1},
           out);
}

void ApplySupplyDrift(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> volts = track.Column("v_bus_V");
  const double usual_V = track.facts->Find("v_bus_V")->mean;
  std::span<const double> drive;
  if (track.facts->Has("drive_amplitude")) drive = track.Column("drive_amplitude");
  const auto missing_V = [&](std::size_t i) {
    if (form.form == 0) return form.shape - volts[i];
    const double level = drive.empty() ? 1 : std::max(drive[i], kDriveLeast);
    // The amplitude is in volts of a light load at nominal drive.
    const double per_volt = form.shape / usual_V;
    return AddedLoadAngle(form.shape, level, 1 - volts[i] / usual_V) / per_volt;
  };
  for (const std::size_t axis : AxesOf(form)) {
    const std::span<const double> step = track.step_deg[axis];
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) { return -amplitude[0] * Direction(step[i]) * missing_V(i); },
        &errors->angle_deg[axis]);
  }
}

}  // namespace

Effect MakeSupplyDrift() {
  return {.cause = "supply_drift",
          .amplitude_unit = "deg/V",
          .prior_size = 0.05,
          .owner = Owner::kPlate,
          .needs = {"v_bus_V"},
          .paragraph =
              "The supply (a battery, a warm regulator) sinks while the campaign runs, and "
              "the lag of all units grows with it. Log and regulate the voltage.",
          .list = ListSupplyDrift,
          .apply = ApplySupplyDrift,
          .distortions = kOfMoves,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
