// The state of an axis' mechanics. Together with FLASH it is all that outlives power-off and the
// process.
#pragma once

#include <cstdint>

namespace focalfleet::sim {

struct AxisMemory {
  double rotor_turns = 0;  // motor turns from the axis' zero
  double output_deg = 0;   // behind gear and play
  double scatter_deg = 0;  // present step scatter of the output
  double rotor_reference_turns = 0;
  double output_reference_deg = 0;
  std::uint64_t moves = 0;  // scatter draws so far
  bool operator==(const AxisMemory&) const = default;
};

}  // namespace focalfleet::sim
