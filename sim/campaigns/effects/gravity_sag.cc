// Gravity sag: everything sinks as the telescope tilts.
#include <cmath>
#include <numbers>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListGravitySag(const CampaignFacts& facts, Templates* out) {
  (void)facts;
  out->push_back({.axis = EffectAxis::kNone, .label = "all fibres alike"});
  out->push_back(
      {.axis = EffectAxis::kNone, .columns = 2, .form = 1, .label = "in a free direction"});
}

void ApplyGravitySag(const UnitTrack& track, const Template& form,
                     std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> elevation = track.Column("elevation_deg");
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double along = std::cos(elevation[i] * std::numbers::pi / 180) * 1e-3;
    if (form.form == 0) errors->y_mm[i] -= amplitude[0] * along;
    if (form.form == 1) errors->x_mm[i] += amplitude[0] * along;
    if (form.form == 1) errors->y_mm[i] += amplitude[1] * along;
  }
}

}  // namespace

Effect MakeGravitySag() {
  return {.cause = "gravity_sag",
          .amplitude_unit = "um",
          .prior_size = 5,
          .owner = Owner::kPlate,
          .needs = {"elevation_deg"},
          .paragraph =
              "The plate or the camera's mount sinks under gravity: all fibres shift the same "
              "way, in proportion to gravity's part along the plate.",
          .list = ListGravitySag,
          .apply = ApplyGravitySag,
          // Without elevations a plate that sags is a shift of the image.
          .passes_for = {"camera_similarity"},
          .traits = {.image_motion = MotionOfImage::kAlongALine}};
}

}  // namespace focalfleet::sim
