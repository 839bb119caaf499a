#include "sim/diagnosis/screen.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/effects/harmonic.h"

namespace focalfleet::sim {
namespace {

constexpr int kCurves = 5;  // cosines over the ranks
enum Channel { kThetaAngle, kPhiAngle, kPlaceX, kPlaceY, kThetaOdd, kPhiOdd, kChannels };
constexpr const char* kChannelNames[] = {"theta angle",
                                         "phi angle",
                                         "x",
                                         "y",
                                         "theta angle against its direction",
                                         "phi angle against its direction"};

void ApplyCurve(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                PoseErrors* errors) {
  const std::span<const float> rank =
      std::span<const float>(track.facts->Find(form.covariate)->rank)
          .subspan(track.first_row, track.moves);
  double direction = 0;
  const std::size_t axis = form.form == kPhiOdd ? kPhi : kTheta;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double curve = amplitude[0] * std::cos(std::numbers::pi * form.shape * double{rank[i]});
    if (track.restarts[i] != 0) direction = 0;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    if (form.form == kThetaAngle) errors->angle_deg[kTheta][i] += curve;
    if (form.form == kPhiAngle) errors->angle_deg[kPhi][i] += curve;
    if (form.form == kPlaceX) errors->x_mm[i] += 0.1 * curve;
    if (form.form == kPlaceY) errors->y_mm[i] += 0.1 * curve;
    if (form.form >= kThetaOdd) errors->angle_deg[axis][i] += curve * direction;
  }
}

void ApplyRipple(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                 PoseErrors* errors) {
  AddHarmonic(track, AxisIndex(form), form.shape, amplitude, errors);
}

void ListNone(const CampaignFacts&, Templates*) {}

const Effect& Curve() {
  static const Effect effect{.cause = "curve",
                             .amplitude_unit = "deg",
                             .prior_size = 0.05,
                             .owner = Owner::kUnit,
                             .list = ListNone,
                             .apply = ApplyCurve};
  return effect;
}
const Effect& Ripple() {
  static const Effect effect{.cause = "ripple",
                             .amplitude_unit = "deg",
                             .prior_size = 0.05,
                             .owner = Owner::kUnit,
                             .list = ListNone,
                             .apply = ApplyRipple};
  return effect;
}

}  // namespace

std::string ChannelOf(const Template& look) {
  if (look.effect == &Ripple()) return std::string(Name(look.axis)) + " angle";
  return kChannelNames[look.form];
}

Templates ScreenTemplates(const CampaignFacts& facts) {
  Templates looks;
  for (const auto& [name, column] : facts.columns) {
    if (!column.varies() || name == "sigma_um" || name == "rehomed" || name == "pixel_x" ||
        name == "pixel_y")
      continue;
    for (int channel = 0; channel < kChannels; ++channel)
      for (int curve = 1; curve <= kCurves; ++curve)
        looks.push_back({.effect = &Curve(),
                         .axis = EffectAxis::kNone,
                         .form = channel,
                         .shape = static_cast<double>(curve),
                         .label = "curve",
                         .covariate = name});
  }
  std::vector<double> orders;
  for (double order = 2; order <= 16; order += 0.5) orders.push_back(order);
  for (double order = 17; order <= 60; order += 1) orders.push_back(order);
  for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi})
    for (const double order : orders)
      looks.push_back({.effect = &Ripple(),
                       .axis = axis,
                       .columns = 2,
                       .shape = order,
                       .label = "ripple",
                       .covariate = std::string(kCommand[axis == EffectAxis::kTheta ? 0 : 1])});
  return looks;
}

}  // namespace focalfleet::sim
