#include "sim/world/axis/motor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/check.h"
#include "sim/drive/reduced_drive.h"
#include "sim/drive/start_study.h"

namespace focalfleet::sim {
namespace {
constexpr double kTurn = 2 * std::numbers::pi;
}

Motor::Motor(const Drive::Setting& setting, const Modulation& modulation)
    : parameters_(setting.motor) {
  FOCALFLEET_CHECK(setting.bridge.v_bus_V > 0);
  const ReducedDrive drive(setting, modulation);
  stall_Nm_ = drive.stall_Nm();
  const MotorParameters& p = parameters_;
  amplitude_V_ = stall_Nm_ * p.resistance_ohm / (1.5 * p.flux_linkage_Wb);
  const double damping =
      p.viscous_Nms + 1.5 * p.flux_linkage_Wb * p.flux_linkage_Wb / p.resistance_ohm;
  settling_s_ = p.inertia_kg_m2 / damping;
  if (const auto repeat = CriticalRepeatReal(drive, setting, modulation))
    pull_in_turns_per_s_ = 1 / (modulation.subdivision * *repeat * modulation.carrier_s());
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

}  // namespace focalfleet::sim
