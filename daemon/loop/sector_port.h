// SectorPort is what the shell needs where the daemon owns one sector of a plane: the part that
// takes orders from the plane's coordinator and answers it (daemon/plane/sector_seat.h).
#pragma once

#include <vector>

#include "fleet/coordinator.h"

namespace focalfleet {

class SectorPort {
 public:
  SectorPort() = default;
  SectorPort(const SectorPort&) = delete;
  SectorPort& operator=(const SectorPort&) = delete;
  virtual ~SectorPort() = default;

  /// Takes in what has arrived, and appends commands and notes for the coordinator's next step,
  /// which comes before the next call.
  virtual void Gather(HostInstant now, const Coordinator& coordinator,
                      std::vector<Command>* commands, std::vector<ShellNote>* notes) = 0;
  /// The effects of that step. Replies of the plane's commands are taken out.
  virtual void Take(Effects* effects) = 0;
  [[nodiscard]] virtual HostInstant wake_at() const = 0;
};

}  // namespace focalfleet
