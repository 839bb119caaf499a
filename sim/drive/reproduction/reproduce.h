// Paper 1, claim by claim, from the drive's physics: times, waves, starts, positions. The paper's
// parameters are stated here (its voltages, counts, repeats). Its results are not; the simulation
// is only compared with them.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "sim/drive/motor/motor_parameters.h"
#include "sim/drive/reproduction/claim.h"

namespace focalfleet::sim {

struct ReproduceOptions {
  /// Waves are those of one set; starts are tried with every set.
  std::string_view wave_set = "9";
  std::vector<std::string_view> start_sets = {"C", "V", "W", "9", "J2"};
  /// Multiplies every phase resistance; claims that rest on the resistance change.
  double resistance_factor = 1;
  /// Every critical n is searched at PWM level (the first 60 turns at the worst load). The twelve
  /// moves of the start rule are made there with the n found and with one less. The cost is some
  /// twenty minutes of CPU time instead of seconds. Heat over ramps and the bare motor stay
  /// reduced.
  bool full = false;
  std::uint64_t seed = 1;
};

/// `progress` receives the share done, 0..1, and the name of the next part. Pre: the sets exist.
using ReproduceProgress = std::function<void(double share, std::string_view next)>;
Reproduction Reproduce(const ReproduceOptions& options, const ReproduceProgress& progress);

}  // namespace focalfleet::sim
