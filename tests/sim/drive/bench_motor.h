// The motor of all benches. Its pull-in speed comes from an integration, so it is made once.
#pragma once

#include "sim/world/axis/motor.h"

namespace focalfleet::sim::test {

inline const Motor& BenchMotor() {
  static const Motor motor({}, {});
  return motor;
}

}  // namespace focalfleet::sim::test
