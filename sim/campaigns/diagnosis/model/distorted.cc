#include "sim/campaigns/diagnosis/model/distorted.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"

namespace focalfleet::sim {
namespace {

constexpr double kDriveLeast = 0.05;

}  // namespace

std::size_t AxisOfChannel(const Template& form, std::size_t channel) {
  if (form.axis == EffectAxis::kTheta || form.axis == EffectAxis::kPhi) return AxisIndex(form);
  return channel % 2;
}

Conditions ConditionsOf(const UnitTrack& track) {
  Conditions out;
  for (const std::size_t axis : {kTheta, kPhi}) {
    out.direction[axis].resize(track.moves);
    double last = 0;
    for (std::size_t i = 0; i < track.moves; ++i) {
      if (track.restarts[i] != 0) last = 0;
      if (track.step_deg[axis][i] != 0) last = Direction(track.step_deg[axis][i]);
      out.direction[axis][i] = last;
    }
  }
  if (track.facts->Has("drive_amplitude")) out.drive = track.Column("drive_amplitude");
  return out;
}

double FactorOf(Distortion distortion, const UnitTrack& track, const Conditions& conditions,
                std::size_t axis, std::size_t move, double relative) {
  switch (distortion) {
    case Distortion::kOwn:
      return 1;
    case Distortion::kBend:
      return std::abs(relative);
    case Distortion::kDirection:
      return conditions.direction[axis][move];
    case Distortion::kCosine:
      return std::cos(track.cmd_deg[axis][move] * kRadiansPerDegree);
    case Distortion::kSine:
      return std::sin(track.cmd_deg[axis][move] * kRadiansPerDegree);
    case Distortion::kDrive:
      break;
  }
  return conditions.drive.empty() ? 0 : 1 / std::max(conditions.drive[move], kDriveLeast);
}

PoseErrors ErrorsOf(const UnitTrack& track, const ModelTerm& term, std::size_t unit) {
  PoseErrors errors;
  errors.Reset(track.moves);
  if (const std::span<const double> amplitude = term.AmplitudeOf(unit); !amplitude.empty())
    AddErrors(track, term.form, amplitude, &errors);
  return errors;
}

void AddDistorted(const UnitTrack& track, const Discrepancy& of, std::size_t unit,
                  std::span<const double> amplitude, PoseErrors* errors) {
  const PoseErrors done = ErrorsOf(track, of.term, unit);
  const Conditions conditions = ConditionsOf(track);
  for (std::size_t c = 0; c < done.channels().size(); ++c) {
    if (!(of.size[c] > 0)) continue;
    const std::vector<double>& error = *done.channels()[c];
    std::vector<double>& out = *errors->channels()[c];
    const std::size_t axis = AxisOfChannel(of.term.form, c);
    for (std::size_t i = 0; i < track.moves; ++i)
      for (std::size_t d = 0; d < amplitude.size(); ++d)
        if (amplitude[d] != 0)
          out[i] +=
              amplitude[d] * error[i] * of.scale[d] *
              (FactorOf(of.distortions[d], track, conditions, axis, i, error[i] / of.size[c]) -
               of.mean[d]);
  }
}

void AddDiscrepancy(const UnitTrack& track, const Discrepancy& discrepancy, std::size_t unit,
                    PoseErrors* errors) {
  if (discrepancy.distortions.empty() || discrepancy.term.group_of_unit[unit] == kNoGroup) return;
  std::vector<double> amplitude = discrepancy.common;
  if (!discrepancy.own.empty())
    for (std::size_t d = 0; d < amplitude.size(); ++d)
      amplitude[d] += discrepancy.own[unit * amplitude.size() + d];
  AddDistorted(track, discrepancy, unit, amplitude, errors);
}

}  // namespace focalfleet::sim
