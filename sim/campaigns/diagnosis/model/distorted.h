// The errors that the distortions of a term's shape make (discrepancy.h), as the model predicts
// them.
#pragma once

#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

/// A unit's errors by a term, and the conditions of the factors that distort them.
struct Undistorted {
  PoseErrors errors;
  std::vector<double> direction[2];  // of each axis' last move; 0: none since the homing
  std::span<const double> drive;     // empty: not known
};
Undistorted UndistortedOf(const UnitTrack& track, const ModelTerm& term, std::size_t unit);

/// The factor by which a distortion differs from the error in a channel of one move. `size`: rms
/// error in the channel.
double FactorOf(Distortion distortion, const UnitTrack& track, const Undistorted& of,
                const Template& form, std::size_t channel, std::size_t move, double size);

/// Adds the errors of a distortion at this amplitude.
void AddDistortion(const UnitTrack& track, const Discrepancy& discrepancy, const Undistorted& of,
                   std::size_t distortion, double amplitude, PoseErrors* errors);

}  // namespace focalfleet::sim
