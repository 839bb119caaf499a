// What can spoil a campaign and is none of the causes: poses that are told wrongly, a sensor that
// hears another one, bends, drifts, lags behind, or whose own electronics feel the temperature.
// Some gains, places and a width together imitate such a thing nearly to within the noise, so that
// nothing is left to see in the residuals. It is found out as a rival: where one number of these
// explains the readings better than the causes that were named do with several, the names do not
// hold, and what is told is that something else is going on, and which it resembles.
//
// Each is one number, 0 where it is not there. Units: rad of the angle for a function of the pose;
// else V for what OutsideSlope says.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/hall/rotation.h"

namespace focalfleet::sim {

enum class OutsideKind {
  kPose,         // an angle is told wrongly
  kHears,        // a sensor hears a share of another one
  kBendsSquare,  // its voltage is not straight in the field
  kBendsCube,
  kDrifts,  // its offset changes over the campaign
  kGainDrifts,
  kLag,               // it remembers a share of the reading before
  kFeelsTemperature,  // its offset changes with temp_C
  kGainFeelsTemperature,
};

struct OutsideEffect {
  OutsideKind kind = OutsideKind::kPose;
  int sensor = -1;        // -1: of all alike
  std::size_t other = 0;  // sensor that is heard
  int angle = 0;          // alpha, beta, gamma
  int function = 0;       // of the pose
};

std::vector<OutsideEffect> OutsideEffects(std::size_t sensors, bool has_temperature);

double PoseFunction(int function, const Orientation& reported);

/// What an effect's slope depends on.
struct OutsideMoment {
  double signal_V = 0;  // of the sensor itself
  double other_V = 0;   // of the other one, or of the reading before
  double share = 0;     // of the campaign, -0.5..0.5
  double warm_K = 0;    // from the mean
};
/// V for an effect of size 1. Pre: not kPose.
double OutsideSlope(OutsideKind kind, const OutsideMoment& at);

/// "v3 hears v4".
std::string Text(const OutsideEffect& effect);

}  // namespace focalfleet::sim
