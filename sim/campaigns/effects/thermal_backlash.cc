// Thermal backlash: clearance and viscosity change with temperature.
#include <cmath>
#include <iterator>
#include <vector>

#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/thermal_mass.h"

namespace focalfleet::sim {
namespace {

// Form 0 is in proportion to temperature. Forms 1 and 2 follow Andrade's law of stiffening grease,
// viscosity in proportion to exp(B / T). Their slope at the reference temperature is that of form
// 0. Form 3 is form 0 for gears that are as warm as the unit around them, which is late.
constexpr int kLate = 3;
constexpr double kAndrade_K[] = {0, 1750, 2750};
constexpr double kZero_K = 273.15;

double Warmer(int form, double temperature_C, double from_C) {
  if (form == 0) return temperature_C - from_C;
  const double b_K = kAndrade_K[form], from_K = from_C + kZero_K;
  const double stiffer = std::exp(b_K / (temperature_C + kZero_K) - b_K / from_K);
  return (1 - stiffer) * from_K * from_K / b_K;
}

void ListThermalBacklash(const CampaignFacts& facts, Templates* out) {
  const FilledColumn* temperature = facts.Find("temp_C");
  const std::vector<double> from = {20, temperature->mean, temperature->first};
  ListGrid({.shapes = from, .shape_name = "from, C,"}, out);
  for (const int form : {1, 2})
    ListGrid({.shapes = from, .shape_name = "as grease stiffens, from, C,", .form = form}, out);
  if (facts.Has("t_s"))
    ListGrid({.shapes = {std::begin(kTimeConstants_s), std::end(kTimeConstants_s)},
              .shape_name = "late by a time constant of, s,",
              .form = kLate},
             out);
}

void ApplyThermalBacklash(const UnitTrack& track, const Template& form,
                          std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> temperature = track.Column("temp_C");
  std::vector<double> late;
  if (form.form == kLate) late = Late(temperature, track.Column("t_s"), form.shape);
  const double usual_C = track.facts->Find("temp_C")->mean;
  const auto warmer = [&](std::size_t i) {
    return form.form == kLate ? late[i] - usual_C : Warmer(form.form, temperature[i], form.shape);
  };
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) { return -amplitude[0] / 2 * Direction(step[i]) * warmer(i); },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeThermalBacklash() {
  return {.cause = "thermal_backlash",
          .amplitude_unit = "deg/K",
          .prior_size = 0.005,
          .owner = Owner::kUnit,
          .needs = {"temp_C"},
          .paragraph =
              "The clearance of the gears or the viscosity of their grease depends on "
              "temperature, so that the error after a reversal does. Approach from one side, "
              "or compensate by the measured temperature.",
          .list = ListThermalBacklash,
          .apply = ApplyThermalBacklash,
          .distortions = kOfMoves,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
