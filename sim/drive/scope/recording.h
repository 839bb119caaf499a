// What a scope and a power meter see of a motor that runs: samples of its first field turns, and
// of every vector the rotor's lag and the mean torque. Two beginnings: in steady rotation, as on a
// bench where somebody has brought the motor up to speed; or at rest behind the vector, as a unit
// starts, where the load decides whether the rotor follows. Whatever happens is recorded; a stall
// is no error.
#pragma once

#include <complex>
#include <cstddef>
#include <optional>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/start_study.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim {

struct RecordingPlan {
  int turns = 2;  // of the field, sampled
  bool from_rest = false;
  /// From rest: the field turns so often at full speed at least, so that the rotor's fate shows.
  int turns_to_judge = StartTrial{}.turns;
  Ramp ramp;            // from rest only
  double sample_s = 0;  // 0: SampleTime
};

/// A power of two of samples a turn of the field: 32 or more a carrier period, fewer (8 at least)
/// where that would be more than about half a million in all.
double SampleTime(const Modulation& modulation, int turns);

/// Samples that the plan will take, and carrier periods that it will run.
struct RecordingSize {
  double samples = 0;
  double carriers = 0;
};
RecordingSize SizeOf(const Modulation& modulation, const RecordingPlan& plan);

/// At the end of a vector.
struct VectorRecord {
  double t_s = 0;
  double lag_rad = 0;  // of the rotor behind the middle of the vector
  double torque_Nm = 0;
};

struct Recording {
  std::vector<DriveSample> samples;
  double sample_s = 0;
  std::vector<VectorRecord> vectors;  // of the whole run
  /// Over all turns that were sampled; what is periodic (harmonics, ripple) in the last of them.
  /// The ripple of a stall is not a number.
  WaveFigures figures;
  std::vector<double> harmonics_A;     // of that turn: amplitudes, from 0 (the mean)
  std::vector<double> carrier_peak_A;  // of that turn: highest current of a phase, per carrier
  DriveEnergy spent;                   // over all turns sampled; stored: its rise
  /// The rotor ends in the field's turn; and, begun in rotation, the load has a lag at all.
  bool in_step = false;
  double lag_rad = 0;          // mean over the run's last turn
  double speed_rad_per_s = 0;  // likewise
  [[nodiscard]] double energy_balance() const {
    const double used_J = spent.copper_J + spent.switching_J + spent.load_J + spent.viscous_J;
    return (spent.supply_J - used_J - spent.stored_J) / spent.supply_J;
  }
};

/// The gearhead's load begins at its highest place from rest; a steady rotation has the mean load
/// throughout. Pre: plan.turns > 0. Cost: some microseconds a carrier period.
Recording Record(const Drive::Setting& setting, const Modulation& modulation,
                 const RecordingPlan& plan);

}  // namespace focalfleet::sim
