// A recording is the view of a scope and a power meter on a motor that runs. The recording holds
// samples of the first field turns, and for every vector the rotor's lag and the mean torque. A
// recording begins in one of two ways. In steady rotation the motor has been brought up to speed,
// as on a bench. At rest behind the vector it starts as a unit does, and the load decides whether
// the rotor follows. A stall is recorded like any other course and is no error.
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
  /// From rest the field turns at least this often at full speed, so that the rotor's fate shows.
  int turns_to_judge = StartTrial{}.turns;
  Ramp ramp;            // from rest only
  double sample_s = 0;  // 0: SampleTime
};

/// The time between samples, for a power of two of samples a turn of the field. They are 32 or more
/// a carrier period, or fewer (at least 8) where 32 would give more than about half a million in
/// all.
double SampleTime(const Modulation& modulation, int turns);

/// The samples that the plan takes, and the carrier periods that it runs.
struct RecordingSize {
  double samples = 0;
  double carriers = 0;
};
RecordingSize SizeOf(const Modulation& modulation, const RecordingPlan& plan);

/// The state at the end of a vector.
struct VectorRecord {
  double t_s = 0;
  double lag_rad = 0;  // of the rotor behind the middle of the vector
  double torque_Nm = 0;
};

struct Recording {
  std::vector<DriveSample> samples;
  double sample_s = 0;
  std::vector<VectorRecord> vectors;  // of the whole run
  /// The figures cover all sampled turns; periodic quantities (harmonics, ripple) cover the last of
  /// them. The ripple of a stall is not a number.
  WaveFigures figures;
  std::vector<double> harmonics_A;     // of that turn: amplitudes, from 0 (the mean)
  std::vector<double> carrier_peak_A;  // of that turn: highest current of a phase, per carrier
  DriveEnergy spent;                   // over all turns sampled; stored: its rise
  /// The rotor ends in the field's turn. A recording that began in rotation also needs a lag that
  /// carries the load.
  bool in_step = false;
  double lag_rad = 0;          // mean over the run's last turn
  double speed_rad_per_s = 0;  // likewise
  [[nodiscard]] double energy_balance() const {
    const double used_J = spent.copper_J + spent.switching_J + spent.load_J + spent.viscous_J;
    return (spent.supply_J - used_J - spent.stored_J) / spent.supply_J;
  }
};

/// The load of the gearhead begins at its highest place from rest; a steady rotation has the mean
/// load throughout. Pre: plan.turns > 0. Cost: some microseconds a carrier period.
Recording Record(const Drive::Setting& setting, const Modulation& modulation,
                 const RecordingPlan& plan);

}  // namespace focalfleet::sim
