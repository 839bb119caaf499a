// The drive without its carrier. Currents are averaged over a carrier period and settle at once:
// their time constant is 2.5 us, while a vector lasts 60 us and more. A vector is then a mean
// voltage, and
//
//   i = (v_k - j w flux e^(j theta)) / (r + j w L),   T = 1.5 flux Im(i e^(-j theta))
//
// drives the same shaft as the drive at PWM level. The mean voltages v_k come from that level, with
// the rotor blocked. They therefore contain the wave mode, the rounding to counts and the effect of
// dead time. Ripple and switching losses come from that level too, because the mean current does
// not contain them. Left out are the shift, by back-EMF, of the instants at which dead time changes
// sign, and the settling of the currents.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "sim/drive/drive.h"

namespace focalfleet::sim {

class ReducedDrive {
 public:
  /// Cost: 20 time constants of each vector at PWM level. Keep one per modulation and copy it.
  ReducedDrive(const Drive::Setting& setting, const Modulation& modulation);

  void Place(double angle_rad, double speed_rad_per_s);
  /// Every place has this load from now on. The rotor stands at 0; place it.
  void SetLoad(double load_Nm);
  /// Shows `count` vectors from `first` on (backwards for a negative count), each for `repeat`
  /// carrier periods. `repeat` need not be whole.
  void RunVectors(std::int64_t first, std::int64_t count, double repeat);
  void RunVectors(std::int64_t first, std::int64_t count) {
    RunVectors(first, count, modulation_.repeat);
  }

  [[nodiscard]] const Shaft& shaft() const { return shaft_; }
  [[nodiscard]] double t_s() const { return t_s_; }
  [[nodiscard]] double copper_J() const { return copper_J_; }
  /// Electrical input, copper, switching and energy into the shaft. Units: J.
  [[nodiscard]] double supply_J() const {
    return copper_J_ + switching_J_ + shaft_.load_J() + shaft_.viscous_J() + shaft_.kinetic_J();
  }
  /// The torque on a blocked rotor that lags the vector by a right angle, mean over vectors. Units:
  /// Nm.
  [[nodiscard]] double stall_Nm() const { return stall_Nm_; }

 private:
  struct Vector {
    std::complex<double> voltage_V;
    double ripple_A2 = 0;  // mean square of i about its mean
    double switching_W = 0;
  };
  [[nodiscard]] std::complex<double> Current(const Vector& vector, double angle_rad,
                                             double speed_rad_per_s) const;

  Drive::Setting setting_;
  Modulation modulation_;
  Shaft shaft_;
  std::vector<Vector> vectors_;
  double stall_Nm_ = 0;
  double t_s_ = 0;
  double copper_J_ = 0;
  double switching_J_ = 0;
};

}  // namespace focalfleet::sim
