// RunSimulator runs focalfleet-sim as a process. The process has a simulated world on the scaled
// monotonic clock, doors to its buses, a control socket, and a FLASH file. The file is read at the
// start and written at the end. A single thread sleeps until the world's next event, a frame, a
// control line or a signal.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

struct SimulatorOptions {
  std::string units_path;
  std::string state_path;               // empty: all units folded
  std::string unix_directory;           // either this,
  std::vector<std::string> interfaces;  // or these, in ascending order of bus_id
  std::string control_path;             // empty: none
  std::string flash_path;               // empty: FLASH is lost at the end
  std::string faults_path;              // empty: no faults from a file
  std::string camera_directory;         // where the daemon asks for exposures; empty: no camera
  std::string fiducials_path;           // fiducials that the camera sees beside the fibres
  double camera_noise_um = 2;           // of one coordinate of a usual spot
  double camera_air_um = 0;             // likewise, the same for neighbours
  double speed = 1;
  std::uint64_t seed = 1;
  sim::Spread spread = sim::Spread::kNominal;
  std::vector<sim::PlantedTrait> planted = {};  // in addition to the spread
  std::uint32_t bit_rate_bps = 1'000'000;
  struct ClockError {
    std::vector<std::uint32_t> units;
    double share = 0;
  };
  std::vector<ClockError> clock_errors = {};
};

/// Runs until SIGTERM, SIGINT or the verb `quit`. Prints `ready` on stdout when everything is open.
/// Errors: what could not be read, opened or, at the end, written.
Status RunSimulator(const SimulatorOptions& options);

}  // namespace focalfleet::simulator
