// The errors that the distortions of a term's shape make (discrepancy.h), as the model predicts
// them.
#pragma once

#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

/// The conditions of a unit's factors, in each of its moves.
struct Conditions {
  std::vector<double> direction[2];  // of the last move; 0: none since the homing
  std::span<const double> drive;     // empty: not known
};

Conditions ConditionsOf(const UnitTrack& track);

/// The axis whose moves and angle a channel's errors go with.
std::size_t AxisOfChannel(const Template& form, std::size_t channel);

/// The factor of the error in one move. `relative`: the error in units of the channel's.
double FactorOf(Distortion distortion, const UnitTrack& track, const Conditions& conditions,
                std::size_t axis, std::size_t move, double relative);

/// The errors of the term itself in this unit.
PoseErrors ErrorsOf(const UnitTrack& track, const ModelTerm& term, std::size_t unit);

/// Adds the errors of all distortions at these amplitudes. Shape: amplitude (distortions).
void AddDistorted(const UnitTrack& track, const Discrepancy& of, std::size_t unit,
                  std::span<const double> amplitude, PoseErrors* errors);

}  // namespace focalfleet::sim
