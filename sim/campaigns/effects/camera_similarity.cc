// Camera similarity: the image shifts once, as when the camera was touched. The image terms
// (sim/campaigns/diagnosis/terms/image.h) describe motion of the image from exposure to exposure.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListCameraSimilarity(const CampaignFacts& facts, Templates* out) {
  constexpr std::size_t kPlaces = 24;
  const std::size_t exposures = facts.exposures.size();
  if (exposures < 8 || facts.campaign->units.size() < 3) return;
  const double gap = std::max(1.0, static_cast<double>(exposures) / kPlaces);
  std::vector<double> shapes;
  for (double at = gap; at < static_cast<double>(exposures) - 1; at += gap) shapes.push_back(at);
  ListGrid({.axes = {EffectAxis::kNone},
            .shapes = shapes,
            .shape_name = "the image shifts once, before exposure",
            .columns = 2},
           out);
}

void ApplyCameraSimilarity(const UnitTrack& track, const Template& form,
                           std::span<const double> amplitude, PoseErrors* errors) {
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t exposure = track.facts->exposures.of_row[track.RowOf(i)];
    if (static_cast<double>(exposure) < form.shape) continue;
    errors->x_mm[i] += 1e-3 * amplitude[0];
    errors->y_mm[i] += 1e-3 * amplitude[1];
  }
}

}  // namespace

Effect MakeCameraSimilarity() {
  return {.cause = "camera_similarity",
          .amplitude_unit = "um",
          .prior_size = 10,
          .owner = Owner::kCamera,
          .needs = {},
          .paragraph =
              "The whole image has shifted at one moment: the camera or its mount was touched. Tie "
              "each exposure to fiducials.",
          .list = ListCameraSimilarity,
          .apply = ApplyCameraSimilarity,
          .continuous_shape = true,
          .traits = {.is_of_camera = true}};
}

}  // namespace focalfleet::sim
