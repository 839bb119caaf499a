#include "sim/drive/motor/shaft.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::sim {

void Shaft::Place(double angle_rad, double speed_rad_per_s) {
  angle_rad_ = angle_rad;
  speed_rad_per_s_ = speed_rad_per_s;
  gear_rad_ = speed_rad_per_s < 0 ? angle_rad : angle_rad - gear_.play_rad;
}

bool Shaft::InContact(double direction) const {
  const double slack = 1e-9;
  return direction > 0 ? angle_rad_ - gear_rad_ >= gear_.play_rad - slack
                       : angle_rad_ - gear_rad_ <= slack;
}

double Shaft::LoadTorque() const {
  return motor_.load_Nm *
         (1 + motor_.load_variation * std::cos(output_rad() - gear_.load_phase_rad));
}

double Shaft::MiddleSpeed(double torque_Nm, double step_s) const {
  const double direction = speed_rad_per_s_ != 0 ? speed_rad_per_s_ : torque_Nm;
  const double load = InContact(direction) ? LoadTorque() : 0;
  if (speed_rad_per_s_ == 0 && std::abs(torque_Nm) <= load) return 0;
  const double net =
      torque_Nm - motor_.viscous_Nms * speed_rad_per_s_ - std::copysign(load, direction);
  const double middle = speed_rad_per_s_ + net * step_s / (2 * motor_.inertia_kg_m2);
  return speed_rad_per_s_ * middle < 0 ? 0 : middle;
}

void Shaft::Turn(double by_rad) {
  angle_rad_ += by_rad;
  gear_rad_ = std::clamp(gear_rad_, angle_rad_ - gear_.play_rad, angle_rad_);
}

void Shaft::Step(double impulse_Nms, double step_s) {
  const double before = speed_rad_per_s_;
  const double direction = before != 0 ? before : impulse_Nms;
  const double load = InContact(direction) ? LoadTorque() : 0;
  if (before == 0 && std::abs(impulse_Nms) <= load * step_s) return;
  const double friction = std::copysign(load, direction) * step_s;
  // The drag acts with the mean of the speeds before and after; the equation is solved for the
  // latter.
  const double drag = motor_.viscous_Nms * step_s / 2;
  const double inertia = motor_.inertia_kg_m2;
  const double after = ((inertia - drag) * before + impulse_Nms - friction) / (inertia + drag);
  if (before * after < 0) {
    // The rotor comes to rest within the step: friction takes the rest of the energy.
    const double mean = before / 2;
    const double turned = mean * step_s * before / (before - after);
    load_J_ += kinetic_J() + impulse_Nms * mean - motor_.viscous_Nms * mean * mean * step_s;
    viscous_J_ += motor_.viscous_Nms * mean * mean * step_s;
    speed_rad_per_s_ = 0;
    Turn(turned);
    return;
  }
  const double mean = (before + after) / 2;
  load_J_ += friction * mean;
  viscous_J_ += motor_.viscous_Nms * mean * mean * step_s;
  speed_rad_per_s_ = after;
  Turn(mean * step_s);
}

}  // namespace focalfleet::sim
