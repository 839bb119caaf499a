// The settings of one bus.
#pragma once

#include <cstdint>

#include "protocol/base/instants.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet::sim {

struct BusOptions {
  std::uint32_t bit_rate_bps = 1'000'000;
  bool bit_clock = true;  // false: a frame takes no time, and nothing destroys it
  std::uint32_t mailboxes_max = 4096;
  HostInstant start{0};
  /// The time from the host's bus-off to its restart; kNever: the host waits for RestartHost.
  /// Units begin their recovery at once.
  DurationNs host_restart = Milliseconds(1000);

  /// The time of `bits` on the wire.
  [[nodiscard]] DurationNs Bits(std::uint32_t bits) const { return BitTime(bits, bit_rate_bps); }
};

}  // namespace focalfleet::sim
