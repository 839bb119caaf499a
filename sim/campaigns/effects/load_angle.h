// The angle by which a rotor stays behind the field that holds it: an arcsine of the load's torque
// over the torque at pull-out, which goes with the drive and with the supply.
#pragma once

#include <algorithm>
#include <cmath>

namespace focalfleet::sim {

/// What a missing share of the voltage adds to it, in radians. `load`: of the pull-out at nominal
/// drive; `level`: of the nominal drive.
inline double AddedLoadAngle(double load, double level, double missing) {
  constexpr double kPullOut = 0.985;  // beyond it the rotor slips, which is another cause
  const auto angle = [&](double drive) {
    return std::asin(std::min(load / std::max(drive, 1e-9), kPullOut));
  };
  return angle(level * (1 - missing)) - angle(level);
}

}  // namespace focalfleet::sim
