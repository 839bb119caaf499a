// The errors that the controllers of a bus count: at the end of a frame, and on a stuck wire. The
// rules have the numbers of error_counters.h.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/instants.h"
#include "sim/world/bus/bus_nodes.h"
#include "sim/world/bus/bus_wire.h"

namespace focalfleet::sim {

/// A frame of `sender` got through at `now` (rules 7 and 8).
void CountWell(std::uint32_t sender, HostInstant now, BusNodes* nodes);

/// `frame` was destroyed, or refused by one node. Returns the nodes that went off by it.
[[nodiscard]] std::vector<std::uint32_t> CountError(const FrameOnWire& frame, HostInstant now,
                                                    BusNodes* nodes);

struct StuckCount {
  std::vector<std::uint32_t> off;  // nodes that went off by it
  bool last = true;                // no node can lose any more
};
/// The step of a dominant wire that is due at `stuck.step_at`. The sixth equal bit is an error
/// (rules 1 and 3), and the flag takes six bits. The bit behind it is dominant (rule 2). Each
/// further eight dominant bits count again (rule 6).
[[nodiscard]] StuckCount CountStuck(const StuckWire& stuck, BusNodes* nodes);

}  // namespace focalfleet::sim
