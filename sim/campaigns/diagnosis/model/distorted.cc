#include "sim/campaigns/diagnosis/model/distorted.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/base/units.h"

namespace focalfleet::sim {
namespace {

// The axis whose moves and angle a channel's errors go with: channels come in pairs of axes.
std::size_t AxisOfChannel(const Template& form, std::size_t channel) {
  if (form.axis == EffectAxis::kTheta || form.axis == EffectAxis::kPhi) return AxisIndex(form);
  return channel % 2;
}

}  // namespace

Undistorted UndistortedOf(const UnitTrack& track, const ModelTerm& term, std::size_t unit) {
  Undistorted out;
  out.errors.Reset(track.moves);
  if (const std::span<const double> amplitude = term.AmplitudeOf(unit); !amplitude.empty())
    AddErrors(track, term.form, amplitude, &out.errors);
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

double FactorOf(Distortion distortion, const UnitTrack& track, const Undistorted& of,
                const Template& form, std::size_t channel, std::size_t move, double size) {
  const std::size_t axis = AxisOfChannel(form, channel);
  switch (distortion) {
    case Distortion::kOwn:
      return 1;
    case Distortion::kBend: {
      // The first order of |e|^(1 + amplitude). An error of 0 stays 0.
      const double relative = std::abs((*of.errors.channels()[channel])[move]) / size;
      return std::log(std::max(relative, std::numeric_limits<double>::min()));
    }
    case Distortion::kDirection:
      return of.direction[axis][move];
    case Distortion::kCosine:
      return std::cos(track.cmd_deg[axis][move] * kRadiansPerDegree);
    case Distortion::kSine:
      return std::sin(track.cmd_deg[axis][move] * kRadiansPerDegree);
    case Distortion::kDrive:
      break;
  }
  return of.drive.empty() ? 0 : 1 / std::max(of.drive[move], kDriveLeast);
}

void AddDistortion(const UnitTrack& track, const Discrepancy& discrepancy, const Undistorted& of,
                   std::size_t distortion, double amplitude, PoseErrors* errors) {
  for (std::size_t c = 0; c < of.errors.channels().size(); ++c) {
    if (!(discrepancy.size[c] > 0)) continue;
    const std::vector<double>& error = *of.errors.channels()[c];
    std::vector<double>& out = *errors->channels()[c];
    for (std::size_t i = 0; i < track.moves; ++i)
      out[i] += amplitude * error[i] *
                (FactorOf(discrepancy.distortions[distortion], track, of, discrepancy.term.form, c,
                          i, discrepancy.size[c]) -
                 discrepancy.mean[distortion]);
  }
}

std::vector<double> Discrepancy::AmplitudeOf(std::size_t unit) const {
  std::vector<double> amplitude(distortions.size(), 0);
  std::ranges::copy(common, amplitude.begin() + static_cast<std::ptrdiff_t>(first_common()));
  for (std::size_t d = 0; !own.empty() && d < amplitude.size(); ++d)
    amplitude[d] += own[unit * amplitude.size() + d];
  return amplitude;
}

void AddDiscrepancy(const UnitTrack& track, const Discrepancy& discrepancy, std::size_t unit,
                    PoseErrors* errors) {
  if (!discrepancy.HasUnit(unit)) return;
  const std::vector<double> amplitude = discrepancy.AmplitudeOf(unit);
  if (std::ranges::all_of(amplitude, [](double a) { return a == 0; })) return;
  const Undistorted of = UndistortedOf(track, discrepancy.term, unit);
  for (std::size_t d = 0; d < amplitude.size(); ++d)
    AddDistortion(track, discrepancy, of, d, amplitude[d], errors);
}

}  // namespace focalfleet::sim
