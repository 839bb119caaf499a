#include "sim/axis/motor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {
constexpr double kTurn = 2 * std::numbers::pi;
}

Motor::Motor(const MotorParameters& parameters, double v_bus_V)
    : parameters_(parameters), amplitude_V_(v_bus_V / std::numbers::sqrt3) {
  FOCALFLEET_CHECK(v_bus_V > 0);
  const MotorParameters& p = parameters_;
  stall_Nm_ = 1.5 * p.flux_linkage_Wb * amplitude_V_ / p.resistance_ohm;
  const double damping =
      p.viscous_Nms + 1.5 * p.flux_linkage_Wb * p.flux_linkage_Wb / p.resistance_ohm;
  settling_s_ = p.inertia_kg_m2 / damping;
  double low = 0;
  double high = 1000;
  for (int i = 0; i < 20; ++i) {
    const double middle = (low + high) / 2;
    (ComesUp(middle) ? low : high) = middle;
  }
  pull_in_turns_per_s_ = low;
}

double Motor::StaticLagTurns(double share) const {
  return std::asin(std::clamp(share * parameters_.load_Nm / stall_Nm_, 0.0, 1.0)) / kTurn;
}

double Motor::RunningLagTurns(double turns_per_s, double share) const {
  const MotorParameters& p = parameters_;
  const double speed = std::abs(turns_per_s) * kTurn;
  const double drag_V =
      p.flux_linkage_Wb * speed +
      p.resistance_ohm * (p.viscous_Nms * speed + share * p.load_Nm) / (1.5 * p.flux_linkage_Wb);
  return std::asin(std::clamp(drag_V / amplitude_V_, 0.0, 1.0)) / kTurn;
}

// Semi-implicit Euler in the field's frame; the load opposes motion, so it cannot push a stalled
// rotor back.
bool Motor::ComesUp(double turns_per_s) const {
  const MotorParameters& p = parameters_;
  const double field_speed = turns_per_s * kTurn;
  const double load = p.load_Nm * (1 + p.load_variation);
  if (load >= stall_Nm_) return false;
  constexpr double kStep = 5e-6;
  double lag = std::asin(load / stall_Nm_);
  double speed = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double drive = 1.5 * p.flux_linkage_Wb *
                         (amplitude_V_ * std::sin(lag) - p.flux_linkage_Wb * speed) /
                         p.resistance_ohm;
    double torque = drive - p.viscous_Nms * speed;
    if (speed > 0) {
      torque -= load;
    } else if (torque > load) {
      torque -= load;
    } else {
      torque = std::min(0.0, torque + load);
    }
    const double before = speed;
    speed += torque / p.inertia_kg_m2 * kStep;
    if (before > 0 && speed < 0) speed = 0;
    lag += (field_speed - speed) * kStep;
    if (lag > std::numbers::pi) return false;  // a whole step was lost
  }
  return true;
}

}  // namespace focalfleet::sim
