// The power of one motor while it turns in step with its field, resolved to the switching edges. A
// carrier period (1.7 to 14 us) is as long as the winding's time constant L/r (2.5 us). The current
// therefore rises and falls within every carrier. Its ripple heats the winding, and the effect of
// the dead time on the voltage depends on where the current passes through zero. A sinusoid of the
// mean voltage has neither. At 1.8 V it is 7 % low with 2000 counts, and 11 % high with 250 counts
// and seven segments.
//
// Equations. Phase quantities are one complex number (amplitude invariant). The flux psi is at the
// angle theta = w t - lag. The speed w = 2 pi / (subdivision * time of a vector) is constant:
//
//   L di/dt = v - r i - e             e = j w psi exp(j theta)
//   v       = (2/3) v_bus (s_a + s_b exp(j 120 deg) + s_c exp(j 240 deg)),  s = 0 or 1
//   torque  = 1.5 psi Im(i exp(-j theta)),   winding = 1.5 r |i|^2,   input = 1.5 Re(v conj(i))
//
// The equation is linear, so i = i_v + i_e. i_e = -e / (r + j w L) is the steady current that the
// turning rotor drives by itself. i_v, the current that the bridge drives, goes to v / r as exp(-t
// r / L) between two edges. Every integral over an interval is thus closed: no step size.
//
// Edges. Vector k stands at the angle 2 pi k / subdivision, a within its sector of 60 degrees: T1 =
// counter1 sin(60 deg - a), T2 = counter1 sin(a), in whole counts. Asymmetric: 000 for the rest,
// then one leg, then two legs, up to the end of the carrier. Five segments: the same legs with
// their pulses centred. Seven segments: centred, half of the rest as 111 in the middle.
//
// Dead time. On a command the conducting switch opens at once, the other closes after the dead
// time. Between them a diode takes the current: the low one where it flows out of the leg, the high
// one where it flows in. Where the current comes to zero before the switch closes, the leg floats
// without current. Edges take their rise or fall time, counted as a delay of half of it. A switch
// may close onto the current of the opposite diode (a hard edge). The switch then carries current
// and voltage together: 0.5 v_bus |i| (rise or fall). Where the current itself has moved the leg (a
// soft edge), there is no such loss.
//
// Lag. The rotor's mean torque is load + viscous w at one lag below pull-out. The lag is found by
// iteration, from the circle of the sinusoid. Where no lag can pull the load the motor is stalled:
// its rotor stands, and the field turns over it.
//
// Cost. A third of an electrical turn repeats by symmetry. The first carriers of each vector are
// taken one by one until the transient of the edge shifts has died out. In the rest only e still
// turns, and one carrier stands for each two degrees. About 1 ms for each drive, mode and voltage.
// Source: paper 1 eqs. 4 to 7, one pole pair, Ld = Lq = L.
#pragma once

#include <cstdint>
#include <map>
#include <tuple>

#include "fleet/drive.h"

namespace focalfleet {

/// The motor and bridge that an estimate assumes (paper 1; flux and load: fitted to its
/// critical n of 37).
struct MotorModel {
  double phase_resistance_ohm = 14.85;
  double phase_inductance_H = 37e-6;
  double flux_linkage_Wb = 0.15e-3;
  double load_torque_Nm = 4.07e-6;  // at the motor shaft
  double viscous_Nms = 1e-8;
  double switch_rise_s = 10e-9;
  double switch_fall_s = 10e-9;
  double dead_time_s = 50e-9;
};

/// The feed of a motor.
struct Feed {
  AxisDrive drive;
  WaveMode mode = WaveMode::kAsymmetric;
  double v_bus_V = 1.8;
};

/// Electrical speed. With one pole pair it is the rotor's, too.
double SpeedRadPerS(const AxisDrive& drive);

/// Electrical power of one motor in steady rotation, by cause. Units: W.
struct MotorPower {
  double winding_W = 0;
  double mechanical_W = 0;
  double switching_W = 0;
  bool stalled = false;  // it cannot pull its load: the rotor stands, mechanical_W is 0
  [[nodiscard]] double total_W() const { return winding_W + mechanical_W + switching_W; }
};

/// The power in steady rotation. Pre: v_bus_V > 0, all counts of the drive > 0. Cost: about 1 ms;
/// keep the result in a DrivePowers.
MotorPower SteadyPower(const MotorModel& motor, const Feed& feed);

/// Means over an electrical turn at a given lag of the rotor behind the field.
struct TurnMeans {
  double supply_W = 0;  // from the bridge's voltages and currents; not the sum of those below
  double winding_W = 0;
  double mechanical_W = 0;
  double switching_W = 0;
  double torque_Nm = 0;
};
struct TurnOptions {
  double lag_rad = 0;
  std::uint32_t first_vector = 0;  // where the turn is cut open; only rounding depends on it
  bool every_carrier = false;      // no carrier stands for others: 5 to 10 times the cost
  bool rotor_stands = false;       // no back EMF; the lag then means nothing
};
TurnMeans MeansOverTurn(const MotorModel& motor, const Feed& feed, const TurnOptions& options);

/// SteadyPower with a memory: each feed is computed once, and the units of a fleet share a few
/// feeds.
class DrivePowers {
 public:
  explicit DrivePowers(const MotorModel& motor) : motor_(motor) {}
  const MotorPower& Of(const Feed& feed);

 private:
  using Key = std::tuple<std::uint16_t, std::uint8_t, std::uint16_t, WaveMode, double>;
  MotorModel motor_;
  std::map<Key, MotorPower> known_;
};

}  // namespace focalfleet
