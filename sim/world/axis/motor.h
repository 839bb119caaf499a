// A motor at the level of the fleet: the lag of its rotor behind its field, and whether the rotor
// follows. Three numbers stand for the drive. They are the mean length V of the voltage vectors,
// the highest speed that a load starts with, and the time in which lag settles. All three come from
// the drive's physics (sim/drive), so they contain the bus voltage, the modulation and the effect
// of dead time.
//
//   at rest      sin(lag) = T_load r / (1.5 flux V)
//   running      sin(lag) = (flux w + r (b w + T_load) / (1.5 flux)) / V
//
// With 1.8 V these are 15 degrees electrical at rest and 24 at n = 108. Against the PWM level the
// running lag is within a degree (tests/sim/world/axis_test.cc).
#pragma once

#include "sim/drive/drive.h"

namespace focalfleet::sim {

class Motor {
 public:
  /// Pre: the bus voltage is above 0. Cost: 30 ms of CPU time; make one per kind of motor.
  Motor(const Drive::Setting& setting, const Modulation& modulation);

  /// The load angle at rest for `share` of the mean load. Units: electrical turns, 0..0.25.
  [[nodiscard]] double StaticLagTurns(double share) const;

  /// The load angle while the field turns at `turns_per_s` (electrical); 0.25 beyond pull-out.
  /// Units: electrical turns.
  [[nodiscard]] double RunningLagTurns(double turns_per_s, double share) const;

  /// True where the rotor, from rest, follows a field that turns at once at `turns_per_s`, at the
  /// worst load of an output turn.
  [[nodiscard]] bool Follows(double turns_per_s) const {
    return turns_per_s <= pull_in_turns_per_s_;
  }
  [[nodiscard]] double pull_in_turns_per_s() const { return pull_in_turns_per_s_; }

  /// The time in which lag settles after the field starts or stops. Units: s.
  [[nodiscard]] double settling_s() const { return settling_s_; }
  [[nodiscard]] const MotorParameters& parameters() const { return parameters_; }

 private:
  MotorParameters parameters_;
  double stall_Nm_ = 0;
  double amplitude_V_ = 0;
  double settling_s_ = 0;
  double pull_in_turns_per_s_ = 0;
};

}  // namespace focalfleet::sim
