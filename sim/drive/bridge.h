// A two-level three-phase bridge has three legs, each with an upper and a lower switch and a diode
// beside each. A command opens one switch and, after the dead time, closes the other. While both
// are open the current decides. Current out of the leg (i > 0) comes through the lower diode,
// current into the leg through the upper one. Where the current has died out the leg floats.
//
// The leg's voltage changes along a ramp. Meanwhile the device that carries the current also
// carries the voltage, and heats. A switch acts in the middle of its gate's ramp: a leg's own ramp
// lies around that instant. A leg that floats, or stands at the right rail already, is taken over
// at that instant.
#pragma once

#include <limits>

namespace focalfleet::sim {

/// The values are those of paper 1: STM32F302 with a MOSFET bridge of 10 ns, 10 ns and 50 ns.
struct Bridge {
  double v_bus_V = 1.8;
  double rise_s = 10e-9;
  double fall_s = 10e-9;
  double dead_time_s = 50e-9;
};

/// The present state of one leg. Times count from the begin of the carrier period.
struct Leg {
  enum class Path { kUpper, kLower, kUpperDiode, kLowerDiode, kFloats };

  bool commanded_high = false;
  Path path = Path::kLower;
  double closes_at_s = kNever;  // when the commanded switch closes after the dead time
  bool gate_rises = false;      // the dead time is over, the switch is about to conduct
  double voltage_V = 0;         // against the negative rail
  double slope_V_per_s = 0;
  double ramp_ends_at_s = kNever;

  static constexpr double kNever = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool open() const {
    return path == Path::kUpperDiode || path == Path::kLowerDiode || path == Path::kFloats;
  }
  /// Begins the ramp to the rail that `path` ties the leg to, if it is not there.
  void FollowPath(const Bridge& bridge, double now_s);
};

}  // namespace focalfleet::sim
