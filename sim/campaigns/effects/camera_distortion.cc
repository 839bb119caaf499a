// Camera distortion: the camera bends the plate's image.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListCameraDistortion(const CampaignFacts& facts, Templates* out) {
  if (facts.campaign->units.size() < 4) return;
  out->push_back({.axis = EffectAxis::kNone, .label = "radial, third order"});
  out->push_back({.axis = EffectAxis::kNone, .columns = 2, .form = 1, .label = "decentred"});
  out->push_back({.axis = EffectAxis::kNone,
                  .columns = 6,
                  .form = 2,
                  .label = "radial of third and fifth order, decentred, trefoil"});
  out->push_back({.axis = EffectAxis::kNone, .columns = 8, .form = 3, .label = "any third order"});
  // Pixels that are oblong or askew. Turn and scale of the image are camera_similarity.
  out->push_back({.axis = EffectAxis::kNone, .columns = 2, .form = 4, .label = "sheared"});
}

void ApplyCameraDistortion(const UnitTrack& track, const Template& form,
                           std::span<const double> amplitude, PoseErrors* errors) {
  const CampaignFacts& facts = *track.facts;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double x = track.fibre_x_mm[i] / facts.radius_mm;
    const double y = track.fibre_y_mm[i] / facts.radius_mm;
    const double r2 = x * x + y * y;
    if (form.form == 3) {
      const double cubes[] = {x * x * x, x * x * y, x * y * y, y * y * y};
      for (std::size_t k = 0; k < 4; ++k) {
        errors->x_mm[i] += 1e-3 * amplitude[k] * cubes[k];
        errors->y_mm[i] += 1e-3 * amplitude[k + 4] * cubes[k];
      }
    } else if (form.form == 2) {
      const double* a = amplitude.data();
      const double radial = a[0] * r2 + a[1] * r2 * r2;
      errors->x_mm[i] += 1e-3 * (radial * x + a[2] * (r2 + 2 * x * x) + a[3] * 2 * x * y +
                                 a[4] * (x * x - y * y) - a[5] * 2 * x * y);
      errors->y_mm[i] += 1e-3 * (radial * y + a[3] * (r2 + 2 * y * y) + a[2] * 2 * x * y -
                                 a[4] * 2 * x * y - a[5] * (x * x - y * y));
    } else if (form.form == 4) {
      errors->x_mm[i] += 1e-3 * (amplitude[0] * x + amplitude[1] * y);
      errors->y_mm[i] += 1e-3 * (amplitude[1] * x - amplitude[0] * y);
    } else if (form.form == 0) {
      errors->x_mm[i] += amplitude[0] * 1e-3 * r2 * x;
      errors->y_mm[i] += amplitude[0] * 1e-3 * r2 * y;
    } else {
      errors->x_mm[i] += 1e-3 * (amplitude[0] * (r2 + 2 * x * x) + amplitude[1] * 2 * x * y);
      errors->y_mm[i] += 1e-3 * (amplitude[1] * (r2 + 2 * y * y) + amplitude[0] * 2 * x * y);
    }
  }
}

}  // namespace

Effect MakeCameraDistortion() {
  return {.cause = "camera_distortion",
          .amplitude_unit = "um",
          .prior_size = 20,
          .owner = Owner::kCamera,
          .needs = {},
          .paragraph =
              "The camera's lens maps the plate with a distortion that its model lacks: "
              "displacements that grow with the third power of the distance from its centre, "
              "the same at every exposure.",
          .list = ListCameraDistortion,
          .apply = ApplyCameraDistortion};
}

}  // namespace focalfleet::sim
