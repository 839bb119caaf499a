#include "sim/hall/fibre_carrier.h"

#include <algorithm>
#include <limits>

#include "protocol/wire/messages.h"

namespace focalfleet::sim {
namespace {

// Four nodes fewer a direction than the array's own rule: the error is 1e-4 of the peak, below the
// noise.
constexpr int kNodes = 6;

SensorElectronics BoardElectronics(double noise_T) {
  SensorElectronics electronics;
  electronics.step_V = electronics.supply_V / kFullCount;
  electronics.noise_T = noise_T;
  return electronics;
}

}  // namespace

TipEstimate TipOf(const Orientation& orientation,
                  const std::array<std::array<double, 3>, 3>& covariance_rad2, double length_mm) {
  const double sin_alpha = std::sin(orientation.alpha_rad);
  const double cos_alpha = std::cos(orientation.alpha_rad);
  const double sin_beta = std::sin(orientation.beta_rad);
  const double cos_beta = std::cos(orientation.beta_rad);
  TipEstimate tip{.x_mm = length_mm * sin_beta, .y_mm = -length_mm * sin_alpha * cos_beta};
  // The derivatives by alpha and beta.
  const double x_by[2] = {0, length_mm * cos_beta};
  const double y_by[2] = {-length_mm * cos_alpha * cos_beta, length_mm * sin_alpha * sin_beta};
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t j = 0; j < 2; ++j) {
      tip.var_x_mm2 += x_by[i] * covariance_rad2[i][j] * x_by[j];
      tip.cov_xy_mm2 += x_by[i] * covariance_rad2[i][j] * y_by[j];
      tip.var_y_mm2 += y_by[i] * covariance_rad2[i][j] * y_by[j];
    }
  return tip;
}

Orientation TiltOf(const FibreCarrierTip& tip) {
  const double sin_beta = std::clamp(tip.x_mm / tip.length_mm, -1.0, 1.0);
  const double cos_beta = std::sqrt(1 - sin_beta * sin_beta);
  const double along = -tip.y_mm / tip.length_mm;
  const double sin_alpha = cos_beta > 0 ? std::clamp(along / cos_beta, -1.0, 1.0) : 0;
  return {std::asin(sin_alpha), std::asin(sin_beta), 0};
}

FibreCarrierJoints::FibreCarrierJoints(const FibreCarrierMake& make)
    : make_(make), magnets_(OneShellArray(), kNodes) {}

void FibreCarrierJoints::Read(UnitId unit, std::uint32_t reading, const FibreCarrierTip& tip,
                              std::span<std::uint16_t> counts) const {
  std::fill(counts.begin(), counts.end(), kNoCount);
  if (counts.size() != 6 && counts.size() != 8) return;
  HallRig rig = FibreCarrierRig(counts.size());
  rig.electronics = BoardElectronics(make_.noise_T);
  Rng made = Rng::Stream(make_.seed, "spine", unit.value);
  Rng noise = Rng::Stream(make_.seed, "spine reading", unit.value ^ std::uint64_t{reading} << 32);
  Orientation tilt = TiltOf(tip);
  tilt.gamma_rad = made.Uniform(-make_.roll_rad, make_.roll_rad);
  const Rotation rotation(tilt);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    HallSensor& sensor = rig.sensors[k];
    sensor.gain += make_.gain_sd * made.Normal();
    sensor.offset_V += make_.offset_sd_V * made.Normal();
    const double b_T = magnets_.Radial_T(rotation.ToRotor(sensor.direction), rig.radius_mm);
    const double voltage_V = Voltage_V(sensor, rig.electronics, b_T, noise.Normal());
    counts[k] =
        static_cast<std::uint16_t>(std::lround(voltage_V / rig.electronics.supply_V * kFullCount));
  }
}

double FibreCarrierJoints::Field_T(double theta_rad, double phi_rad) const {
  const Vector3 direction{std::sin(theta_rad) * std::cos(phi_rad),
                          std::sin(theta_rad) * std::sin(phi_rad), std::cos(theta_rad)};
  return magnets_.Radial_T(direction, kSensorRadius_mm);
}

HallRig FibreCarrierRig(std::size_t sensors) {
  HallRig rig;
  rig.sensors = sensors == 6 ? SixSensors() : EightSensors();
  return rig;
}

std::vector<double> VoltagesOf(std::span<const std::uint16_t> counts,
                               const SensorElectronics& electronics) {
  std::vector<double> voltages_V;
  for (const std::uint16_t count : counts)
    voltages_V.push_back(count == kNoCount ? std::numeric_limits<double>::quiet_NaN()
                                           : electronics.supply_V * count / kFullCount);
  return voltages_V;
}

}  // namespace focalfleet::sim
