// Relaxation: the arm creeps after the move.
#include <algorithm>
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Seconds since the axis came to rest, at each exposure.
std::vector<double> RestTimes(const UnitTrack& track, std::size_t axis) {
  const std::span<const double> delay = track.Column("delay_s");
  std::span<const double> time;
  if (track.facts->Has("t_s")) time = track.Column("t_s");
  std::vector<double> rest(track.moves);
  double ended = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double own = std::max(delay[i], 0.0);
    rest[i] = own;
    if (time.empty()) continue;
    if (i == 0 || track.step_deg[axis][i] != 0) ended = time[i] - own;
    rest[i] = std::max(time[i] - ended, own);
  }
  return rest;
}

void ListRelaxation(const CampaignFacts&, Templates* out) {
  // Form 0 is seen once, and then held. Form 1 goes by the exposure's delay, form 2 by the time
  // since the axis came to rest.
  const std::vector<double> times_s = {0.3, 1, 3, 10, 30, 100};
  ListGrid({.shapes = times_s, .shape_name = "time constant, s,"}, out);
  ListGrid(
      {.shapes = times_s, .shape_name = "by the exposure's delay; time constant, s,", .form = 1},
      out);
  ListGrid({.shapes = times_s, .shape_name = "as time passes; time constant, s,", .form = 2}, out);
}

// A creep that is over before the exposures looks like play.
bool ShowsRelaxation(const Template& form, const CampaignFacts& facts) {
  constexpr double kLeftMin = 0.15;  // of the creep, root mean square
  const std::vector<double>& delay_s = facts.Find("delay_s")->values;
  double square = 0;
  for (const double delay : delay_s) square += std::exp(-2 * std::max(delay, 0.0) / form.shape);
  return square >= kLeftMin * kLeftMin * static_cast<double>(delay_s.size());
}

void ApplyRelaxation(const UnitTrack& track, const Template& form,
                     std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> delay = track.Column("delay_s");
  const auto crept = [&](double seconds) {
    return -amplitude[0] * (1 - std::exp(-std::max(seconds, 0.0) / form.shape));
  };
  if (form.form == 0) {
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) { return Direction(step[i]) * crept(delay[i]); },
        &errors->angle_deg[axis]);
    return;
  }
  std::vector<double> rest;
  if (form.form == 2) rest = RestTimes(track, axis);
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i]) direction = 0;
    if (step[i] != 0) direction = Direction(step[i]);
    errors->angle_deg[axis][i] += direction * crept(form.form == 2 ? rest[i] : delay[i]);
  }
}

}  // namespace

Effect MakeRelaxation() {
  return {.cause = "relaxation",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {"delay_s"},
          .paragraph =
              "After the motor has stopped the arm creeps back for seconds, against the "
              "direction of the move. Wait longer before the exposure, or expose always at "
              "the same delay.",
          .list = ListRelaxation,
          .apply = ApplyRelaxation,
          .continuous_shape = true,
          .distortions = kOfMoves,
          .shows = ShowsRelaxation,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
