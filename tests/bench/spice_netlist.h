// SpiceNetlist describes a motor on its bridge as a netlist for ngspice, from settings alone. Its
// comparators, dead time, switches, diodes and rotor are ngspice's, and the compare values are
// derived here independently. A vector of length V_bus / sqrt(3) at angle a needs the phase
// voltages
//
//   u_x = V_bus / sqrt(3) cos(a - 120 deg x)
//
// With a floating star only their differences count. The legs are high for C (u_x - u_min) / V_bus
// counts. Where the mode shares the rest of the period, they are high for half of it longer.
//
// Each leg has these parts: two comparators on the carrier's sawtooth (beyond `on`, not beyond
// `off`), gates, near-ideal switches, and a near-ideal diode beside each. The gates pass a change
// on at once (open), or after the dead time (close) and half the rise time more. A leg steps where
// the drive's ramps: in the middle of the ramp, which gives the same volt-seconds.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "protocol/base/ids.h"

namespace focalfleet::bench {

/// The settings of a case. Units: SI, torques at the motor's shaft. Currents start at 0, all legs
/// low.
struct SpiceCase {
  double v_bus_V = 0;
  double clock_Hz = 0;
  int counter1 = 0;
  int repeat = 0;
  int subdivision = 0;
  WaveMode mode = WaveMode::kAsymmetric;
  double dead_time_s = 0;
  double rise_s = 0;  // and fall time
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

/// The netlist. ngspice writes motor.raw where it is started: phase currents, the rotor's angle and
/// speed every `sample_s`. At the first sample, one `sample_s` after ngspice's 0, the first carrier
/// period begins and the rotor is released.
std::string Netlist(const SpiceCase& setting);

struct SpiceRow {
  double t_s = 0;
  std::array<double, 3> current_A{};
  double angle_rad = 0;
  double speed_rad_per_s = 0;
};
/// The rows that ngspice wrote. Empty: the file is no binary raw file with these columns.
std::vector<SpiceRow> ReadRaw(const std::string& path);

}  // namespace focalfleet::bench
