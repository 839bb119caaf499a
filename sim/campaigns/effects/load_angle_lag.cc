// Load angle lag: the rotor rests behind its field.
#include <algorithm>
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListLoadAngleLag(const CampaignFacts& facts, Templates* out) {
  // Forms 0 and 1 are a light load, 2 and 3 a heavy one, by the arcsine. Forms 1 and 3 depend on
  // the supply. The amplitude is the lag at nominal drive.
  const std::vector<double> loads = {0.5, 0.8, 0.95};
  constexpr std::string_view kName = "load, of the pull-out at nominal drive,";
  ListGrid({}, out);
  ListGrid({.shapes = loads, .shape_name = kName, .form = 2}, out);
  if (!facts.Has("v_bus_V")) return;
  ListGrid({.form = 1}, out);
  ListGrid({.shapes = loads, .shape_name = kName, .form = 3}, out);
}

// Beyond the pull-out the rotor does not lag, it slips.
bool ShowsLoadAngleLag(const Template& form, const CampaignFacts&) { return form.shape < 1; }

void ApplyLoadAngleLag(const UnitTrack& track, const Template& form,
                       std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> drive = track.Column("drive_amplitude");
  const bool by_supply = form.form % 2 == 1;
  std::span<const double> volts;
  if (by_supply) volts = track.Column("v_bus_V");
  const double usual_V = by_supply ? track.facts->Find("v_bus_V")->mean : 1;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        double level = std::max(drive[i], kDriveLeast);
        if (by_supply && usual_V > 0) level *= std::max(volts[i] / usual_V, 0.05);
        const double lag = form.form >= 2 ? std::asin(std::min(form.shape / level, 1.0)) /
                                                std::asin(std::min(form.shape, 1.0))
                                          : 1 / level;
        return -amplitude[0] * Direction(step[i]) * lag;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeLoadAngleLag() {
  return {.cause = "load_angle_lag",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {"drive_amplitude"},
          .paragraph =
              "Under friction the rotor stops behind the field that holds it, the more the "
              "weaker the drive. It looks like backlash as long as the drive level never "
              "changes.",
          .list = ListLoadAngleLag,
          .apply = ApplyLoadAngleLag,
          .continuous_shape = true,
          .distortions = kOfMoves,
          .shows = ShowsLoadAngleLag,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
