// One 4 mm brushless motor with its gearhead's load, driven open loop: the field is put somewhere,
// the rotor follows behind it by a load angle. Two pole (one electrical turn is one motor turn).
//
//   J w' = 1.5 psi (V sin(lag) - psi w) / r - b w - T_load       V = V_bus / sqrt(3)
//
// At rest the rotor stops where friction holds it: sin(lag) = T_load r / (1.5 psi V), 15.0 degrees
// electrical at 1.8 V. Running at the electrical speed w: sin(lag) = (psi w + r (b w + T_load) /
// (1.5 psi)) / V, 23 degrees at n = 108. Values: flux and load fitted to the critical n = 37 at 1.8
// V.
#pragma once

#include "sim/motor/motor_parameters.h"

namespace focalfleet::sim {

class Motor {
 public:
  /// Pre: v_bus_V > 0. Cost: some tens of thousands of integration steps; make one per kind of
  /// motor.
  Motor(const MotorParameters& parameters, double v_bus_V);

  /// Load angle at rest in electrical turns, 0..0.25, for `share` of the mean load.
  [[nodiscard]] double StaticLagTurns(double share) const;

  /// Load angle while the field turns at `turns_per_s` (electrical), electrical turns; 0.25 beyond
  /// pull-out.
  [[nodiscard]] double RunningLagTurns(double turns_per_s, double share) const;

  /// Whether the rotor, at rest, comes up to a field that turns at once at `turns_per_s`, at the
  /// worst load of an output turn.
  [[nodiscard]] bool Follows(double turns_per_s) const {
    return turns_per_s <= pull_in_turns_per_s_;
  }
  [[nodiscard]] double pull_in_turns_per_s() const { return pull_in_turns_per_s_; }

  /// How fast lag settles after the field starts or stops. Units: s.
  [[nodiscard]] double settling_s() const { return settling_s_; }
  [[nodiscard]] const MotorParameters& parameters() const { return parameters_; }

 private:
  [[nodiscard]] bool ComesUp(double turns_per_s) const;

  MotorParameters parameters_;
  double amplitude_V_;
  double stall_Nm_;
  double settling_s_;
  double pull_in_turns_per_s_ = 0;
};

}  // namespace focalfleet::sim
