// PollablePort is what the event loop needs of a port beyond FramePort. Its one descriptor is
// watched for as long as the port lives, whatever the port closes and opens behind it. The port
// also gives the instant at which it must be called though nothing arrived: to connect again, or
// because a simulated bus goes on.
#pragma once

#include <cstdint>
#include <string>

#include "protocol/link/frame_port.h"

namespace focalfleet {

/// Events of a port that no frame reports, counted since the start.
struct PortCounters {
  std::uint64_t rejected = 0;     // not an extended data frame of 0..8 bytes
  std::uint64_t forged = 0;       // as from a unit, and sent by another program of this host
  std::uint64_t lost = 0;         // the kernel's receive queue overflowed
  std::uint64_t link_errors = 0;  // error frames, failed reads and writes
  std::uint64_t reconnects = 0;   // times the link came up again
};

/// The wait of a port that has no better figure: about eight frames at 1 Mbit/s, in real time.
inline constexpr DurationNs kRetryFull = Milliseconds(1);

class PollablePort : public FramePort {
 public:
  /// Readable when Receive or another Send can succeed. -1: this port only uses wake_at.
  [[nodiscard]] virtual int fd() const = 0;
  [[nodiscard]] virtual HostInstant wake_at() const = 0;
  /// The wait before another Send can succeed, where one was refused and no event reports room.
  /// Units: real time.
  [[nodiscard]] virtual DurationNs retry_full() const = 0;
  [[nodiscard]] virtual const PortCounters& counters() const = 0;
  /// The interface or path, for messages.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// The reason why the link is not up; empty where it is up.
  [[nodiscard]] virtual const std::string& trouble() const = 0;
};

}  // namespace focalfleet
