// A motor on its bridge as a netlist for ngspice, from settings alone: its comparators, dead time,
// switches, diodes and rotor are ngspice's, and the compare values are derived here in a way of
// their own. A vector of length V_bus / sqrt(3) at angle a wants the phase voltages
//
//   u_x = V_bus / sqrt(3) cos(a - 120 deg x)
//
// and with a floating star only their differences count: the legs are high for C (u_x - u_min) /
// V_bus counts, and for half of what is left of the period longer where the mode shares it.
//
// Each leg: the carrier's sawtooth through two comparators (beyond `on`, not beyond `off`), gates
// that pass a change on at once (open) or after the dead time (close) and half the rise time more,
// near-ideal switches, and a near-ideal diode beside each. A leg steps where the drive's ramps: in
// the middle of the ramp, which gives the same volt-seconds.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "protocol/base/ids.h"

namespace focalfleet::bench {

/// Units: SI, torques at the motor's shaft. Currents start at 0, all legs low.
struct SpiceCase {
  double v_bus_V = 0;
  double clock_Hz = 0;
  int counter1 = 0;
  int repeat = 0;
  int subdivision = 0;
  WaveMode mode = WaveMode::kAsymmetric;
  double dead_time_s = 0;
  double rise_s = 0;  // and fall
  double resistance_ohm = 0;
  double inductance_H = 0;
  double flux_Wb = 0;
  double inertia_kg_m2 = 0;
  double viscous_Nms = 0;
  double load_Nm = 0;  // opposes a forward turn
  double angle_rad = 0;
  double speed_rad_per_s = 0;

  double duration_s = 0;
  double sample_s = 0;  // of the output
  double step_max_s = 0;
};

/// Counts at which a leg goes high and low within a carrier period; on == off: stays low.
struct CompareValues {
  double on = 0;
  double off = 0;
};
std::array<CompareValues, 3> CompareValuesOf(const SpiceCase& setting, int vector);

/// The legs' compare values over time, which the netlist reads as references.txt.
std::string References(const SpiceCase& setting);

/// Writes motor.raw where ngspice is started: phase currents, the rotor's angle and speed every
/// `sample_s`. The first carrier period begins, and the rotor is let go, at the first of them, one
/// `sample_s` after ngspice's 0.
std::string Netlist(const SpiceCase& setting);

struct SpiceRow {
  double t_s = 0;
  std::array<double, 3> current_A{};
  double angle_rad = 0;
  double speed_rad_per_s = 0;
};
/// What ngspice wrote. Empty: it is no binary raw file with these columns.
std::vector<SpiceRow> ReadRaw(const std::string& path);

}  // namespace focalfleet::bench
