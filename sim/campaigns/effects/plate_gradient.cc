// Plate gradient: one side of the plate is warmer.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListPlateGradient(const CampaignFacts& facts, Templates* out) {
  if (facts.Has(kGradientX))
    out->push_back({.axis = EffectAxis::kNone, .form = 0, .label = "by the measured gradient"});
  for (const int form : {1, 2, 3})
    out->push_back({.axis = EffectAxis::kNone,
                    .columns = 2,
                    .form = form,
                    .label = form == 1   ? "a gradient that grows with temperature"
                             : form == 2 ? "a stretch that grows with temperature"
                                         : "along the gradient, by its square"});
}

void ApplyPlateGradient(const UnitTrack& track, const Template& form,
                        std::span<const double> amplitude, PoseErrors* errors) {
  const CampaignFacts& facts = *track.facts;
  const std::span<const double> temperature = track.Column("temp_C");
  const double usual_C = facts.Find("temp_C")->mean;
  std::span<const double> gradient[2];
  if (form.form == 0) gradient[0] = track.Column(kGradientX);
  if (form.form == 0) gradient[1] = track.Column(kGradientY);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double x = track.fibre_x_mm[i];
    const double y = track.fibre_y_mm[i];
    const double warm = temperature[i] - usual_C;
    double a = 0, b = 0;
    if (form.form == 0) a = amplitude[0] * gradient[0][i], b = amplitude[0] * gradient[1][i];
    if (form.form == 1 || form.form == 3)
      a = amplitude[0] * warm / facts.radius_mm, b = amplitude[1] * warm / facts.radius_mm;
    if (form.form == 2) {
      errors->x_mm[i] += warm * (amplitude[0] * x + amplitude[1] * y);
      errors->y_mm[i] += warm * (amplitude[1] * x - amplitude[0] * y);
    } else if (form.form == 3) {
      errors->x_mm[i] += a * x * x;
      errors->y_mm[i] += b * y * y;
    } else {
      errors->x_mm[i] += a * (x * x - y * y) / 2 + b * x * y;
      errors->y_mm[i] += b * (y * y - x * x) / 2 + a * x * y;
    }
  }
}

}  // namespace

Effect MakePlateGradient() {
  return {.cause = "plate_gradient",
          .amplitude_unit = "1/K",
          .prior_size = 1e-5,
          .owner = Owner::kPlate,
          .needs = {"temp_C"},
          .paragraph =
              "A temperature gradient across the plate bends its grid: displacements that "
              "grow with the square of the place on the plate, or stretch it one way. Even "
              "the temperature out, or correct by fiducials.",
          .list = ListPlateGradient,
          .apply = ApplyPlateGradient,
          // The range is far beyond any metal's: sensors at the units see only a part of the
          // plate's gradient.
          .amplitude_low = -0.01,
          .amplitude_high = 0.01,
          .traits = {.image_motion = MotionOfImage::kBends}};
}

}  // namespace focalfleet::sim
