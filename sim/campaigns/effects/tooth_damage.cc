// Tooth damage: a bump at one angle of a gear.
#include <cmath>
#include <string>
#include <vector>

#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Forms 0 and 2 are a tooth of the pinion, which passes once a turn of the pinion. Forms 1 and 3
// are a tooth of the output gear. Forms 2 and 3 are two teeth wide, or as long in mesh.
constexpr bool IsOfPinion(int form) { return form % 2 == 0; }
constexpr bool IsWide(int form) { return form >= 2; }

void ListToothDamage(const CampaignFacts& facts, Templates* out) {
  for (const int form : {0, 1, 2, 3}) {
    if (IsOfPinion(form) && !HasPinion(facts)) continue;
    const int places = IsWide(form) ? 12 : 24;
    std::vector<double> places_deg;
    for (int k = 0; k < places; ++k) places_deg.push_back(360.0 / places * k);
    const std::string name =
        std::string(IsWide(form) ? "wide, " : "") +
        (IsOfPinion(form) ? "at the pinion's angle, deg," : "at the gear's angle, deg,");
    ListGrid({.shapes = places_deg, .shape_name = name, .form = form}, out);
  }
}

// A bump whose top the axis never reaches is the end of a range rather than a tooth.
bool ShowsToothDamage(const Template& form, const CampaignFacts& facts) {
  if (IsOfPinion(form.form)) return true;
  const FilledColumn& angle = facts.columns.at(std::string(kCommand[AxisIndex(form)]));
  return form.shape + 360 * std::ceil((angle.low - form.shape) / 360) <= angle.high;
}

void ApplyToothDamage(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double order = IsOfPinion(form.form) ? PinionRatio(*track.unit, axis) : 1.0;
  const double width_deg = IsWide(form.form) ? 20 : 12;  // of the damaged gear, standard deviation
  constexpr double kFar = 9;  // widths: beyond it the bump is lost in rounding
  const std::optional<double> place_deg = ShapeOf(form, track.unit->id);
  if (!place_deg) return;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double away_deg = WithoutTurns(order * track.cmd_deg[axis][i] - *place_deg);
    const double in_widths = away_deg / width_deg;
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
          .list = ListToothDamage,
          .apply = ApplyToothDamage,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          .own_shape = true,
          .shows = ShowsToothDamage};
}

}  // namespace focalfleet::sim
