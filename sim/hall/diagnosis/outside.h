// Effects that can spoil a campaign and are none of the causes. Poses may be reported wrongly. A
// sensor may pick up another one, bend, drift or lag, or its own electronics may depend on the
// temperature. Some gains, places and a width together imitate such an effect nearly to within the
// noise, so that the residuals show nothing. The effect is therefore found as a rival. Where one
// number of such an effect explains the readings better than several of the named causes, the names
// do not hold. The report then says that another effect is at work, and which one it resembles.
//
// Each effect is one number, 0 where it is absent. Units: rad of the angle for a function of the
// pose, else V as OutsideSlope defines.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/hall/rotation.h"

namespace focalfleet::sim {

enum class OutsideKind {
  kPose,         // an angle is reported wrongly
  kHears,        // a sensor picks up a share of another one
  kBendsSquare,  // its voltage is not linear in the field
  kBendsCube,
  kDrifts,  // its offset changes over the campaign
  kGainDrifts,
  kLag,               // its voltage contains a share of the reading before
  kFeelsTemperature,  // its offset changes with temp_C
  kGainFeelsTemperature,
};

struct OutsideEffect {
  OutsideKind kind = OutsideKind::kPose;
  int sensor = -1;        // -1: all sensors alike
  std::size_t other = 0;  // the sensor that is picked up
  int angle = 0;          // alpha, beta, gamma
  int function = 0;       // of the pose
};

std::vector<OutsideEffect> OutsideEffects(std::size_t sensors, bool has_temperature);

double PoseFunction(int function, const Orientation& reported);

/// The quantities that an effect's slope depends on.
struct OutsideMoment {
  double signal_V = 0;  // of the sensor itself
  double other_V = 0;   // of the other one, or of the reading before
  double share = 0;     // of the campaign, -0.5..0.5
  double warm_K = 0;    // from the mean
};
/// The voltage for an effect of size 1. Units: V. Pre: not kPose.
double OutsideSlope(OutsideKind kind, const OutsideMoment& at);

/// The effect in words, such as "v3 hears v4".
std::string Text(const OutsideEffect& effect);

}  // namespace focalfleet::sim
