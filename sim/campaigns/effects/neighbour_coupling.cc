// Neighbour coupling: the neighbours' motors pull.
#include <cmath>
#include <optional>

#include "protocol/base/units.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Form 1: rotors that stand anywhere at their motors' zeros, each unit's at its own angle.
constexpr int kPhased = 1;
// Angles of a rotor that the pull tells apart: an eighth of a turn loses a tenth of it. Half and
// twice of it: the units are charged by 0.7 less or more in ln L.
constexpr double kAnglesOfARotor = 8;

void ListNeighbourCoupling(const CampaignFacts& facts, Templates* out) {
  if (!facts.Has(kNeighbourTheta)) return;
  ListGrid({}, out);
  for (const std::size_t axis : {kTheta, kPhi}) {
    if (facts.rotor_phase_deg[axis].empty()) continue;
    Templates phased;
    ListGrid({.axes = {axis == kTheta ? EffectAxis::kTheta : EffectAxis::kPhi},
              .shape_name = "rotors at, deg,",
              .form = kPhased},
             &phased);
    out->push_back(WithShapes(phased.front(), facts.rotor_phase_deg[axis]));
    out->back().choices = kAnglesOfARotor;
  }
}

// The pull by the rotors' angles.
void ApplyPhased(const UnitTrack& track, const Template& form, double amplitude,
                 PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const CampaignFacts& facts = *track.facts;
  const std::optional<double> own = ShapeOf(form, track.unit->id);
  if (!own || facts.neighbours.empty()) return;
  for (const std::size_t neighbour : facts.neighbours[track.unit_index]) {
    const auto other = ShapeOf(form, facts.campaign->units[neighbour].id);
    if (!other) continue;
    const double phase = kRadiansPerDegree * (*own - *other);
    for (const PullingPair& pair : PullOf(facts, track.unit_index, neighbour, axis))
      errors->angle_deg[axis][pair.row - track.first_row] +=
          amplitude * pair.nearness * std::sin(pair.angle_rad + phase);
  }
}

void ApplyNeighbourCoupling(const UnitTrack& track, const Template& form,
                            std::span<const double> amplitude, PoseErrors* errors) {
  if (form.form == kPhased) return ApplyPhased(track, form, amplitude[0], errors);
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> pull =
      track.Column(axis == kTheta ? kNeighbourTheta : kNeighbourPhi);
  for (std::size_t i = 0; i < track.moves; ++i)
    errors->angle_deg[axis][i] += amplitude[0] * pull[i];
}

}  // namespace

Effect MakeNeighbourCoupling() {
  return {.cause = "neighbour_coupling",
          .amplitude_unit = "deg",
          .prior_size = 0.01,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The magnets of a neighbour's motor pull at this one's rotor, by the angle "
              "between the two and the cube of their distance.",
          .list = ListNeighbourCoupling,
          .apply = ApplyNeighbourCoupling,
          .form_of_found_shapes = kPhased,
          .traits = {.acts_on_others = true}};
}

}  // namespace focalfleet::sim
