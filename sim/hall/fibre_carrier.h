// The ball-jointed fibre carrier: a unit's fibre stands on a carrier in a ball joint with magnets.
// The file gives the place of the tip at an orientation, and the simulated joint that a unit's
// board reads (unit/joint_sensors.h).
//
// Stator and focal plane have the same x and y, and z points to the sky. The joint is at the unit's
// base. The fibre carrier is the rotor's z axis, so its tip is length * R z, which gamma does not
// move:
//
//   x = length sin(beta)      y = -length sin(alpha) cos(beta)
//
// An array's field at the sensors does not change when all its lengths are scaled alike (magnetised
// pieces in air). The paper's array, 59 mm to the sensors, therefore stands for one that fits a
// plate's pitch.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "sim/hall/magnet_array.h"
#include "sim/hall/orient.h"
#include "sim/world/unit/joint_sensors.h"

namespace focalfleet::sim {

struct TipEstimate {
  double x_mm = 0;  // from the base
  double y_mm = 0;
  double var_x_mm2 = 0;
  double cov_xy_mm2 = 0;
  double var_y_mm2 = 0;
};
/// The tip, and its covariance to first order. `covariance_rad2` is that of alpha, beta, gamma.
TipEstimate TipOf(const Orientation& orientation,
                  const std::array<std::array<double, 3>, 3>& covariance_rad2, double length_mm);

/// The tilt that puts the tip there, with gamma 0. A tip farther away than the fibre carrier is
/// long gives the tilt that comes nearest.
Orientation TiltOf(const FibreCarrierTip& tip);

/// The tolerances to which units' joints are made, and the noise of their boards' readings.
struct FibreCarrierMake {
  std::uint64_t seed = 1;
  double roll_rad =
      1 * kRadPerDeg;  // mounting of a fibre carrier about its own axis, evenly +- this
  double gain_sd = 0;  // of sensors as calibrated, relative
  double offset_sd_V = 0;
  /// The noise of a conversion is 0.5 mT; a reading is the mean of 1024 at 40 kHz, 26 ms.
  double noise_T = 5e-4 / 32;
};

/// Joints of one type, with the paper's one-shell array and 6 or 8 sensors.
class FibreCarrierJoints final : public JointSensors {
 public:
  explicit FibreCarrierJoints(const FibreCarrierMake& make);
  /// Pre: 6 or 8 counts; other numbers are left unread. Cost: about 0.2 ms, a sum over dipoles for
  /// each sensor.
  void Read(UnitId unit, std::uint32_t reading, const FibreCarrierTip& tip,
            std::span<std::uint16_t> counts) const override;

  /// The radial field of the rotors at the sensors' distance. Frame: rotor.
  [[nodiscard]] double Field_T(double theta_rad, double phi_rad) const;

 private:
  FibreCarrierMake make_;
  MagnetArray magnets_;
};

/// The nominal rig of such a unit's board. Pre: 6 or 8 sensors.
HallRig FibreCarrierRig(std::size_t sensors);
/// The counts of the wire as voltages; NaN where there is no reading. Shape: as many as counts.
std::vector<double> VoltagesOf(std::span<const std::uint16_t> counts,
                               const SensorElectronics& electronics);

}  // namespace focalfleet::sim
