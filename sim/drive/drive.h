// A motor on its bridge, computed exactly between switching edges. With a floating star the three
// currents are one complex number i (a, b, c are its projections on 0, 120, 240 degrees). Between
// two events the circuit is linear:
//
//   L di/dt = v(t) - r i - j w flux e^(j theta)        v: the legs' voltages, constant or ramps
//
// The current i(t) is therefore a polynomial plus one exponential; no integration in steps is
// needed. Events are commands, ends of dead times and ramps, and the instants at which a current
// dies out in a diode. The rotor's speed counts as constant between events, at the middle value; it
// changes by 1e-5 in a microsecond. Losses are integrals of the same closed forms. Source: paper 1
// eqs. 1, 2, 5, 9 with Ld = Lq.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <functional>
#include <utility>

#include "sim/drive/bridge.h"
#include "sim/drive/motor/shaft.h"
#include "sim/drive/svpwm.h"

namespace focalfleet::sim {

inline constexpr std::complex<double> kJ{0, 1};  // the imaginary unit

/// The energies since the start. Units: J. supply = copper + switching + load + viscous + the rise
/// of stored, up to rounding and the constant speed between events.
struct DriveEnergy {
  double supply_J = 0;
  double copper_J = 0;
  double switching_J = 0;
  double load_J = 0;
  double viscous_J = 0;
  double stored_J = 0;  // now: winding and rotor
};

/// A sample of a probe. Leg voltages are against the negative rail.
struct DriveSample {
  double t_s = 0;
  std::array<double, kLegCount> current_A{};
  std::array<double, kLegCount> voltage_V{};
  double torque_Nm = 0;
  double angle_rad = 0;
};

/// The interval between two events, as integrals from `t_s` over `step_s`: of t^k i (t from the
/// interval's begin), k = 0..3, of the torque, and of t times the torque.
struct DriveInterval {
  double t_s = 0;
  double step_s = 0;
  std::array<std::complex<double>, 4> moments;
  double impulse_Nms = 0;
  double moment_Nms2 = 0;
};

class Drive {
 public:
  struct Setting {
    MotorParameters motor;
    Gearhead gearhead;
    Bridge bridge;
  };
  explicit Drive(const Setting& setting);

  /// Places the rotor only: currents and legs stay as they are (at first 0 and low).
  void Place(double angle_rad, double speed_rad_per_s) { shaft_.Place(angle_rad, speed_rad_per_s); }
  void SetCurrent(std::complex<double> current_A) { current_ = current_A; }

  /// Runs one carrier period.
  void RunCarrier(const Pattern& pattern, const Modulation& modulation);

  /// `sink` receives samples every `period_s` from now on. An empty function ends the probe.
  using Sink = std::function<void(const DriveSample&)>;
  void Probe(double period_s, Sink sink);
  /// `listener` receives every interval from now on. An empty function ends that.
  using Listener = std::function<void(const DriveInterval&)>;
  void Listen(Listener listener) { listener_ = std::move(listener); }

  [[nodiscard]] double t_s() const { return elapsed_s_; }
  [[nodiscard]] std::complex<double> current_A() const { return current_; }
  [[nodiscard]] double torque_Nm() const;
  [[nodiscard]] const Shaft& shaft() const { return shaft_; }
  [[nodiscard]] DriveEnergy energy() const;
  /// The integral of |i|^2 since the start; half its mean is the mean square of a phase.
  [[nodiscard]] double square_A2s() const { return square_A2s_; }
  /// The highest phase current since `ResetPeak`.
  [[nodiscard]] double peak_A() const { return peak_A_; }
  void ResetPeak() { peak_A_ = 0; }
  [[nodiscard]] std::uint64_t edges() const { return edges_; }  // of commands, all legs
  /// The charge that went through diodes since the start, in either direction. The diodes have no
  /// forward voltage here. The charge times a forward voltage is the energy that it would take, to
  /// first order.
  [[nodiscard]] double diode_C() const { return diode_C_; }

 private:
  // i(t) = c0 + c1 t + c2 t^2 + c3 t^3 + h e^(-t / tau) over one interval. The turn of the
  // back-EMF, at most 1e-2 rad in an interval, is expanded to third order.
  struct Course {
    std::array<std::complex<double>, 4> c;
    std::complex<double> h;
    double rate = 0;  // 1 / tau
    [[nodiscard]] std::complex<double> At(double t) const;
  };

  void Command(Leg* leg, bool high, double now_s, double phase_A);
  void CloseSwitches(double now_s);
  void SettleDiodes(double now_s);
  [[nodiscard]] Course CourseOf(double speed) const;
  [[nodiscard]] double Crossing(const Course& course, double step_s, std::size_t* leg) const;
  void Advance(double now_s, double step_s);
  void Account(const Course& course, double now_s, double step_s, double decay);
  void Emit(const Course& course, double now_s, double step_s, double speed);
  [[nodiscard]] double FloatingVoltage(std::size_t leg) const;

  Setting setting_;
  Shaft shaft_;
  std::array<Leg, kLegCount> legs_;
  std::complex<double> current_;
  std::complex<double> direction_{1, 0};  // e^(j theta)
  double speed_ = 0;                      // in the middle of the interval that runs
  double elapsed_s_ = 0;                  // at the begin of the carrier period
  double supply_J_ = 0;
  double switching_J_ = 0;
  double square_A2s_ = 0;
  double peak_A_ = 0;
  std::uint64_t edges_ = 0;
  double diode_C_ = 0;
  double probe_period_s_ = 0;
  double next_probe_s_ = 0;  // since the begin of the carrier period
  Sink sink_;
  Listener listener_;
};

}  // namespace focalfleet::sim
