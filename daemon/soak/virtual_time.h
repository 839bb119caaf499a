// The clocks of a simulated host. The host's time is the only one that advances, by hand; the time
// of day goes with it and may step. A thread has one simulation at a time, because the daemon reads
// its clocks through plain functions.
#pragma once

#include <cstdint>

#include "daemon/clock/clock.h"

namespace focalfleet::soak {

struct VirtualTime {
  std::int64_t host_ns = 0;
  std::int64_t wall_less_host_ns = 1'700'000'000'000'000'000;
};

inline thread_local VirtualTime t_virtual_time;

inline std::int64_t ReadVirtualNs() { return t_virtual_time.host_ns; }
inline WallTime ReadVirtualWall() {
  return {t_virtual_time.host_ns + t_virtual_time.wall_less_host_ns};
}
inline HostClock VirtualClock() { return HostClock(1, &ReadVirtualNs, &ReadVirtualWall); }

}  // namespace focalfleet::soak
