#include "sim/campaigns/diagnosis/terms/homings.h"

#include <algorithm>

#include "protocol/base/units.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

// ln L that is lost where each unit has one zero for all of its homings.
double LostWithOneZero(const Fit& fit) {
  const auto log_likelihood = [](const Fit& of) { return (NegativeBic(of) + PriceOf(of)) / 2; };
  Fit without = fit;
  for (std::vector<double>& zeros : without.model.homing_zero_deg) zeros.clear();
  UpdateResiduals(&without);
  StepFit(&without);
  return log_likelihood(fit) - log_likelihood(without);
}

// Zeros of an axis beyond the first of each unit, which belongs to its geometry.
double FreeZeros(const Fit& fit, std::size_t axis) {
  double zeros = 0;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const UnitTrack track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
    const auto of_axis = std::ranges::count(FreeHomingsOf(fit.model, track), axis, &Homing::axis);
    zeros += std::max(static_cast<double>(of_axis) - 1, 0.0);
  }
  return zeros;
}

}  // namespace

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
  // The logarithm of an rms of n normal numbers has a sigma of 1/sqrt(2 n).
  const double within = std::exp(1.96 / std::sqrt(2 * std::max(FreeZeros(fit, larger), 1.0)));
  cause.ci95[0] = cause.amplitude / within, cause.ci95[1] = cause.amplitude * within;
  cause.size_um = scatter.both_um();
  cause.delta_log_likelihood = LostWithOneZero(fit);
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit)
    cause.units.push_back(fit.model.units[unit].id);
  cause.all_units = true;
  return cause;
}

}  // namespace focalfleet::sim
