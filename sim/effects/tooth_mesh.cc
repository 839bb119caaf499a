// Tooth mesh: the pitch of the teeth.
#include <vector>

#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  std::vector<double> meshes = {kRingTeeth};
  if (HasPinion(facts)) meshes.insert(meshes.begin(), kOutputTeeth);
  ListGrid({.shapes = meshes, .shape_name = "teeth", .columns = 2}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double order =
      form.shape == kRingTeeth ? kRingTeeth * PinionRatio(*track.unit, axis) : kOutputTeeth;
  AddHarmonic(track, axis, order, amplitude, errors);
}

}  // namespace

Effect MakeToothMesh() {
  return {.cause = "tooth_mesh",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The teeth themselves: a ripple with one period a tooth of the output gear "
              "(order 45), or of the last ring (46 teeth, order 122 with a pinion stage).",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
