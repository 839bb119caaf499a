// Tooth damage: a bump at one angle of a gear.
#include <cmath>
#include <string>
#include <vector>

#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  // Form 0: the pinion's tooth, which comes round with the pinion; form 1: the output gear's.
  constexpr int kPlaces = 24;
  std::vector<double> places_deg;
  for (int k = 0; k < kPlaces; ++k) places_deg.push_back(360.0 / kPlaces * k);
  if (HasPinion(facts))
    ListGrid({.shapes = places_deg, .shape_name = "at the pinion's angle, deg,"}, out);
  ListGrid({.shapes = places_deg, .shape_name = "at the gear's angle, deg,", .form = 1}, out);
}

// A bump of which the axis never comes to the top is the end of a range rather than a tooth.
bool Shows(const Template& form, const CampaignFacts& facts) {
  if (form.form == 0) return true;
  const FilledColumn& angle = facts.columns.at(std::string(kCommand[AxisIndex(form)]));
  return form.shape + 360 * std::ceil((angle.low - form.shape) / 360) <= angle.high;
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double order = form.form == 0 ? PinionRatio(*track.unit, axis) : 1.0;
  constexpr double kWidth_deg = 12;  // of the damaged gear, standard deviation
  constexpr double kFar = 9;         // widths: what is left there is lost in rounding
  const double place_deg = ShapeOf(form, track);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double away_deg = WithoutTurns(order * track.cmd_deg[axis][i] - place_deg);
    const double in_widths = away_deg / kWidth_deg;
    if (std::abs(in_widths) > kFar) continue;
    errors->angle_deg[axis][i] += amplitude[0] * std::exp(-in_widths * in_widths / 2);
  }
}

}  // namespace

Effect MakeToothDamage() {
  return {.cause = "tooth_damage",
          .amplitude_unit = "deg",
          .prior_size = 0.1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "One tooth is worn or chipped: the angle errs by a bump whenever the gear "
              "passes that tooth, at the same place each turn of it and in both directions.",
          .list = List,
          .apply = Apply,
          .continuous_shape = true,
          .own_shape = true,
          .shows = Shows};
}

}  // namespace focalfleet::sim
