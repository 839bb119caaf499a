#include "sim/drive/reduced_drive.h"

#include <cmath>

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;
// A hundredth of the fastest swing of the rotor about its field (0.5 ms at 9 V and 0.3 mWb).
constexpr double kRotorStepMax_s = 20e-6;
// The number of time constants until the currents of a blocked rotor repeat: e^-20.
constexpr double kSettling = 20;

}  // namespace

ReducedDrive::ReducedDrive(const Drive::Setting& setting, const Modulation& modulation)
    : setting_(setting), modulation_(modulation), shaft_(setting.motor, setting.gearhead) {
  Drive::Setting blocked = setting;
  blocked.motor.load_Nm = 1;
  blocked.motor.load_variation = 0;
  const double resistance = setting.motor.resistance_ohm;
  const int settling_carriers = static_cast<int>(
      std::ceil(kSettling * setting.motor.inductance_H / resistance / modulation.carrier_s()));
  vectors_.reserve(static_cast<std::size_t>(modulation.subdivision));
  for (int k = 0; k < modulation.subdivision; ++k) {
    const Pattern pattern = PatternOf(modulation, k);
    Drive drive(blocked);
    drive.Place(0, 0);
    for (int n = 0; n < settling_carriers; ++n) drive.RunCarrier(pattern, modulation);
    Complex charge;
    drive.Listen([&](const DriveInterval& interval) { charge += interval.moments[0]; });
    const double square_before = drive.square_A2s();
    const double switching_before = drive.energy().switching_J;
    drive.RunCarrier(pattern, modulation);
    const Complex mean = charge / modulation.carrier_s();
    const double square = (drive.square_A2s() - square_before) / modulation.carrier_s();
    vectors_.push_back(
        {.voltage_V = mean * resistance,
         .ripple_A2 = square - std::norm(mean),
         .switching_W = (drive.energy().switching_J - switching_before) / modulation.carrier_s()});
    stall_Nm_ += 1.5 * setting.motor.flux_linkage_Wb * std::abs(mean) / modulation.subdivision;
  }
}

void ReducedDrive::Place(double angle_rad, double speed_rad_per_s) {
  shaft_.Place(angle_rad, speed_rad_per_s);
}

void ReducedDrive::SetLoad(double load_Nm) {
  setting_.motor.load_Nm = load_Nm;
  setting_.motor.load_variation = 0;
  shaft_ = Shaft(setting_.motor, setting_.gearhead);
}

Complex ReducedDrive::Current(const Vector& vector, double angle_rad,
                              double speed_rad_per_s) const {
  const MotorParameters& motor = setting_.motor;
  const Complex emf = kJ * (speed_rad_per_s * motor.flux_linkage_Wb) * std::polar(1.0, angle_rad);
  return (vector.voltage_V - emf) /
         Complex(motor.resistance_ohm, speed_rad_per_s * motor.inductance_H);
}

void ReducedDrive::RunVectors(std::int64_t first, std::int64_t count, double repeat) {
  const std::int64_t subdivision = modulation_.subdivision;
  const double vector_s = repeat * modulation_.carrier_s();
  const double steps = std::ceil(vector_s / kRotorStepMax_s);
  const double step_s = vector_s / steps;
  const double flux = setting_.motor.flux_linkage_Wb;
  const auto torque_of = [flux](Complex current, double angle_rad) {
    return 1.5 * flux *
           (current.imag() * std::cos(angle_rad) - current.real() * std::sin(angle_rad));
  };
  const std::int64_t direction = count < 0 ? -1 : 1;
  for (std::int64_t k = 0; k != count; k += direction) {
    const std::int64_t index = (((first + k) % subdivision) + subdivision) % subdivision;
    const Vector& vector = vectors_[static_cast<std::size_t>(index)];
    for (double step = 0; step < steps; step += 1) {
      // Midpoint rule: the torque is taken where the rotor is half a step on.
      const double angle = shaft_.angle_rad();
      const double speed = shaft_.speed_rad_per_s();
      const Complex now = Current(vector, angle, speed);
      const double middle_speed = shaft_.MiddleSpeed(torque_of(now, angle), step_s);
      const double middle_angle = angle + (speed + middle_speed) / 2 * step_s / 2;
      const Complex current = Current(vector, middle_angle, middle_speed);
      shaft_.Step(torque_of(current, middle_angle) * step_s, step_s);
      copper_J_ +=
          1.5 * setting_.motor.resistance_ohm * (std::norm(current) + vector.ripple_A2) * step_s;
      switching_J_ += vector.switching_W * step_s;
    }
    t_s_ += vector_s;
  }
}

}  // namespace focalfleet::sim
