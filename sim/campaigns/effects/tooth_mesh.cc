// Tooth mesh: a ripple at the pitch of the teeth.
#include <vector>

#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListToothMesh(const CampaignFacts& facts, Templates* out) {
  std::vector<double> meshes = {kRingTeeth};
  if (HasPinion(facts)) meshes.insert(meshes.begin(), kOutputTeeth);
  // Form 0 has all teeth alike. In form 1 the ripple is deeper on one side of the gear, as its axis
  // is a little off.
  ListGrid({.shapes = meshes, .shape_name = "teeth", .columns = 2}, out);
  ListGrid({.shapes = meshes, .shape_name = "deeper on one side; teeth", .form = 1, .columns = 6},
           out);
}

void ApplyToothMesh(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                    PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double once = form.shape == kRingTeeth ? PinionRatio(*track.unit, axis) : 1;
  const double order = form.shape * once;
  AddHarmonic(track, axis, order, amplitude.first(2), errors);
  if (form.form == 0) return;
  // A wave whose depth changes once a turn is the sum of the wave and two beside it.
  AddHarmonic(track, axis, order - once, amplitude.subspan(2, 2), errors);
  AddHarmonic(track, axis, order + once, amplitude.subspan(4, 2), errors);
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
              "(order 45), or of the last ring (46 teeth, order 122 with a pinion stage), alike "
              "all around or deeper on one side.",
          .list = ListToothMesh,
          .apply = ApplyToothMesh,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
