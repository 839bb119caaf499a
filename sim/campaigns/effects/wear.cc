// Wear: a parameter drifts with the turns made.
#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr double kTurns = 100;  // a campaign's usual turns; a life test makes thousands

constexpr std::string_view kColumns[] = {"cycles_theta", "cycles_phi"};  // of theta, of phi

// The power of ten next to the campaign's turns: amplitudes are errors of its size.
double SpanOf(const CampaignFacts& facts) {
  double most = kTurns;
  const Campaign& campaign = *facts.campaign;
  for (const std::string_view column : kColumns) {
    if (!facts.Has(column)) continue;
    const std::span<const double> cycles = facts.Find(column)->values;
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      const std::size_t begin = campaign.first_row[unit], end = campaign.first_row[unit + 1];
      if (begin < end) most = std::max(most, cycles[end - 1] - cycles[begin]);
    }
  }
  return std::pow(10, std::round(std::log10(most)));
}

void ListWear(const CampaignFacts& facts, Templates* out) {
  std::vector<EffectAxis> axes;
  if (facts.Has(kColumns[kTheta])) axes.push_back(EffectAxis::kTheta);
  if (facts.Has(kColumns[kPhi])) axes.push_back(EffectAxis::kPhi);
  const std::vector<double> span = {SpanOf(facts)};
  constexpr std::string_view kNames[] = {"over turns,", "the clearance opens; over turns,",
                                         "the scale drifts; over turns,"};
  for (int form = 0; form < 3; ++form)
    ListGrid({.axes = axes, .shapes = span, .shape_name = kNames[form], .form = form}, out);
}

void ApplyWear(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
               PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> cycles = track.Column(kColumns[axis]);
  const double span = form.shape > 0 ? form.shape : kTurns;
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    // Turns count since the campaign began: earlier wear is backlash or scale already.
    const double worn = (cycles[i] - cycles[0]) / span;
    if (track.restarts[i]) direction = 0;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    double error = worn;
    if (form.form == 1) error = -worn * direction;
    if (form.form == 2) error = worn * track.cmd_deg[axis][i] / 90;
    errors->angle_deg[axis][i] += amplitude[0] * error;
  }
}

}  // namespace

Effect MakeWear() {
  return {.cause = "wear",
          .amplitude_unit = "deg over its span of turns",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {kColumns[kTheta], kColumns[kPhi]},
          .paragraph =
              "The unit changes with the turns it has made, slowly and without return: its "
              "zero creeps, its clearance opens, or its scale drifts. Re-calibrate by turns, "
              "not by the calendar.",
          .list = ListWear,
          .apply = ApplyWear,
          .one_is_enough = true,
          .amplitude_low = -20,  // a gear that falls apart
          .amplitude_high = 20};
}

}  // namespace focalfleet::sim
