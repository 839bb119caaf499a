// Centroid bias: a spot is measured towards its pixel's middle.
#include <cmath>
#include <numbers>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListCentroidBias(const CampaignFacts& facts, Templates* out) {
  (void)facts;
  out->push_back({.axis = EffectAxis::kNone, .columns = 2, .label = "period of one pixel"});
  out->push_back({.axis = EffectAxis::kNone,
                  .columns = 4,
                  .form = 1,
                  .label = "period of one pixel, other in y than in x"});
}

void ApplyCentroidBias(const UnitTrack& track, const Template& form,
                       std::span<const double> amplitude, PoseErrors* errors) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const std::span<const double> x = track.Column("pixel_x");
  const std::span<const double> y = track.Column("pixel_y");
  const std::span<const double> in_y = form.form == 1 ? amplitude.subspan(2) : amplitude;
  for (std::size_t i = 0; i < track.moves; ++i) {
    errors->x_mm[i] +=
        1e-3 * (amplitude[0] * std::sin(kTurn * x[i]) + amplitude[1] * std::cos(kTurn * x[i]));
    errors->y_mm[i] += 1e-3 * (in_y[0] * std::sin(kTurn * y[i]) + in_y[1] * std::cos(kTurn * y[i]));
  }
}

}  // namespace

Effect MakeCentroidBias() {
  return {.cause = "centroid_bias",
          .amplitude_unit = "um",
          .prior_size = 3,
          .owner = Owner::kCamera,
          .needs = {"pixel_x", "pixel_y"},
          .paragraph =
              "The measured centre of a spot depends on where in a pixel it falls. Dither the "
              "camera by half a pixel, or fit the spot's true shape.",
          .list = ListCentroidBias,
          .apply = ApplyCentroidBias};
}

}  // namespace focalfleet::sim
