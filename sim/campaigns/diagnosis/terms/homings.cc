#include "sim/campaigns/diagnosis/terms/homings.h"

#include "protocol/base/units.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {

HomingScatter ScatterOfHomings(const Fit& fit) {
  constexpr double kUmPerDegAndMm = kUmPerMm * kRadiansPerDegree;  // of arc, at a radius of 1 mm
  const CampaignUnit& first = fit.model.units.front();
  const double lever_mm[2] = {std::hypot(first.arm_mm[0], first.arm_mm[1]), first.arm_mm[1]};
  HomingScatter scatter;
  for (const std::size_t axis : {kTheta, kPhi}) {
    double square = 0;
    for (const double zero : fit.model.homing_zero_deg[axis]) square += zero * zero;
    scatter.rms_deg[axis] = std::sqrt(square / static_cast<double>(fit.weight.size()));
    scatter.um[axis] = scatter.rms_deg[axis] * kUmPerDegAndMm * lever_mm[axis];
  }
  return scatter;
}

CauseFound HomingCause(const Fit& fit) {
  CauseFound cause = CauseNamed(kZeroOffset);
  cause.scope = "unit";
  cause.amplitude_unit = "deg";
  cause.shape = "differs from homing to homing; the amplitude is the rms of the larger axis";
  cause.paragraph =
      "The zero is not the same after each homing: measure it after every homing, and look at the "
      "hard stop.";
  const HomingScatter scatter = ScatterOfHomings(fit);
  const std::size_t larger = scatter.um[kTheta] >= scatter.um[kPhi] ? kTheta : kPhi;
  cause.amplitude = scatter.rms_deg[larger];
  cause.axis = Name(larger == kTheta ? EffectAxis::kTheta : EffectAxis::kPhi);
  cause.ci95[0] = 0.7 * cause.amplitude, cause.ci95[1] = 1.4 * cause.amplitude;
  cause.size_um = scatter.both_um();
  cause.delta_log_likelihood = static_cast<double>(fit.weight.size());
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit)
    cause.units.push_back(fit.model.units[unit].id);
  cause.all_units = true;
  return cause;
}

}  // namespace focalfleet::sim
