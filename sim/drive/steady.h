// A motor that turns in step with its field, as a bench sees it after the start, whatever the start
// was. The rotor's speed is the field's, and its lag is the one at which the mean torque meets the
// load. The state is found at PWM level. The rotor is made too heavy to change its speed, and the
// lag is searched on the stable branch, where more lag gives more torque.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sim/drive/drive.h"

namespace focalfleet::sim {

struct SteadyState {
  double lag_rad = 0;  // of the rotor behind the middle of the vector that is shown
  double speed_rad_per_s = 0;
  double torque_Nm = 0;            // mean
  std::complex<double> current_A;  // at the begin of vector 0
};

/// None: no lag gives the torque that the load and the drag need, and the rotor would stall.
/// `load_Nm` stands for the whole load at one place. Cost: some ten thirds of an electrical turn.
std::optional<SteadyState> FindSteadyState(const Drive::Setting& setting,
                                           const Modulation& modulation, double load_Nm);

/// The highest mean torque of steady rotation over the lag; load and drag share it. Units: Nm.
double PullOutTorque(const Drive::Setting& setting, const Modulation& modulation);

/// Mean power by cause. Units: W.
struct DrivePower {
  double supply_W = 0;
  double copper_W = 0;
  double switching_W = 0;
  double mechanical_W = 0;  // load and drag
};

/// The readings of a scope and a power meter over one electrical turn. Currents are of a phase.
struct WaveFigures {
  double peak_A = 0;
  double rms_A = 0;
  double fundamental_A = 0;  // amplitude
  /// Paper 1: the power of the fundamental over that of all but the first six harmonics (DC counts
  /// as noise).
  double snr_dB = 0;
  double thd = 0;  // all but fundamental and DC, over the fundamental
  /// The ripple is that of the running mean of the torque over a carrier period, over its mean.
  double torque_mean_Nm = 0;
  double torque_ripple_peak_to_peak = 0;
  double torque_ripple_rms = 0;
  double supply_A = 0;
  double edges_per_carrier = 0;
  double diode_A = 0;  // mean through all diodes
  DrivePower power;
};

/// Pre: `state` belongs to the same setting and modulation. Cost: an electrical turn and a vector.
WaveFigures MeasureSteadyWave(const Drive::Setting& setting, const Modulation& modulation,
                              const SteadyState& state);

/// A drive that turns steadily, with vector 0 about to begin, and with its own inertia and load
/// again.
Drive InSteadyRotation(const Drive::Setting& setting, const Modulation& modulation,
                       const SteadyState& state);

/// Shows `count` vectors from `first` on, backwards for a negative count.
void RunVectors(Drive* drive, const Modulation& modulation, const std::vector<Pattern>& table,
                std::int64_t first, std::int64_t count);

}  // namespace focalfleet::sim
