// The rotor and its load: inertia, viscous drag, and a gearhead. The gearhead's dry friction
// opposes motion and changes over an output turn. Rotor and gearhead have play between them: while
// the rotor crosses it, the friction does not act.
//
//   J w' = T - b w - T_load(output) sign(w)        at rest: w' = 0 while |T| <= T_load
//
// Time goes in steps, for each of which the drive's torque is given as an impulse. The speed is
// linear within a step, so the error of a step is of third order.
#pragma once

#include <numbers>

#include "sim/drive/motor/motor_parameters.h"

namespace focalfleet::sim {

/// The contribution of the gearhead. Angles in radians of the rotor.
struct Gearhead {
  double ratio = 337.0 * 45 / 17;  // rotor turns an output turn
  double load_phase_rad = 0;       // output angle of the highest load
  double play_rad = 0;             // full width
};

class Shaft {
 public:
  Shaft(const MotorParameters& motor, const Gearhead& gearhead) : motor_(motor), gear_(gearhead) {}

  /// Sets the rotor to this angle and speed. The gearhead is in contact in the direction of
  /// `speed`, forward at rest.
  void Place(double angle_rad, double speed_rad_per_s);

  [[nodiscard]] double angle_rad() const { return angle_rad_; }
  [[nodiscard]] double speed_rad_per_s() const { return speed_rad_per_s_; }
  [[nodiscard]] double output_rad() const { return gear_rad_ / gear_.ratio; }

  /// The speed in the middle of a step of `step_s` that begins with drive torque `torque_Nm`.
  [[nodiscard]] double MiddleSpeed(double torque_Nm, double step_s) const;
  /// Advances by `step_s` with `impulse_Nms`, the integral of the drive's torque.
  void Step(double impulse_Nms, double step_s);

  [[nodiscard]] double LoadTorque() const;  // friction as of now, Nm, never negative
  [[nodiscard]] double kinetic_J() const {
    return 0.5 * motor_.inertia_kg_m2 * speed_rad_per_s_ * speed_rad_per_s_;
  }
  [[nodiscard]] double load_J() const { return load_J_; }        // spent on dry friction
  [[nodiscard]] double viscous_J() const { return viscous_J_; }  // spent on drag

 private:
  [[nodiscard]] bool InContact(double direction) const;
  void Turn(double by_rad);

  MotorParameters motor_;
  Gearhead gear_;
  double angle_rad_ = 0;
  double speed_rad_per_s_ = 0;
  double gear_rad_ = 0;  // gearhead's input: within play_rad behind angle_rad_
  double load_J_ = 0;
  double viscous_J_ = 0;
};

}  // namespace focalfleet::sim
