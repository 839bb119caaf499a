// The load angle is the angle by which a rotor stays behind the field that holds it. Its sine is
// the ratio of the load's torque to the torque at pull-out. The latter is in proportion to the
// drive and to the supply voltage.
#pragma once

#include <algorithm>
#include <cmath>

namespace focalfleet::sim {

/// The angle that a missing share of the voltage adds, in radians. `load` is in units of the
/// pull-out at nominal drive, `level` in units of the nominal drive.
inline double AddedLoadAngle(double load, double level, double missing) {
  constexpr double kPullOut = 0.985;  // beyond it the rotor slips, which is another cause
  const auto angle = [&](double drive) {
    return std::asin(std::min(load / std::max(drive, 1e-9), kPullOut));
  };
  return angle(level * (1 - missing)) - angle(level);
}

}  // namespace focalfleet::sim
