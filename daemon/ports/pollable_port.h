// What the event loop needs of a port beyond FramePort: one descriptor to watch for as long as the
// port lives (whatever it has to close and open behind it), and the instant at which it wants to be
// called though nothing came (to connect again, or because a simulated bus moves on by itself).
#pragma once

#include <cstdint>
#include <string>

#include "protocol/link/frame_port.h"

namespace focalfleet {

/// What a port saw that no frame tells. Counted since the start.
struct PortCounters {
  std::uint64_t rejected = 0;     // not an extended data frame of 0..8 bytes
  std::uint64_t lost = 0;         // the kernel's receive queue overflowed
  std::uint64_t link_errors = 0;  // error frames, failed reads and writes
  std::uint64_t reconnects = 0;   // times the link came up again
};

class PollablePort : public FramePort {
 public:
  /// Readable when Receive or another Send is worth while. -1: this port only goes by wake_at.
  [[nodiscard]] virtual int fd() const = 0;
  [[nodiscard]] virtual HostInstant wake_at() const = 0;
  /// How soon another Send is worth while where one was refused and nothing tells of room. In real
  /// time; as it is, about eight frames at 1 Mbit/s.
  [[nodiscard]] virtual DurationNs retry_full() const { return Milliseconds(1); }
  [[nodiscard]] virtual const PortCounters& counters() const = 0;
  /// The interface or path, for people.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Why the link is not up; empty where it is.
  [[nodiscard]] virtual const std::string& trouble() const = 0;
};

}  // namespace focalfleet
