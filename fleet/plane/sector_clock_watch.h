// The alarm of a plane's clocks. A sector whose clock is known to less than plans allow for takes
// part in no round, and its strip stands: someone has to look at its network or its host. A single
// bad exchange is no alarm, a while of them is. The alarm is the plane's and names all such
// sectors; a further one raises it again, and it ends with the last.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "fleet/coordinate/inputs.h"
#include "fleet/plane/sector_book.h"

namespace focalfleet {

class SectorClockWatch {
 public:
  explicit SectorClockWatch(DurationNs patience) : patience_(patience) {}

  /// Appends the alarm, or its end. Cost: a look at each sector's clock.
  void Look(const SectorBook& sectors, HostInstant now, std::vector<ShellNote>* notes);

 private:
  /// The sector's clock has been loose since then.
  struct Loose {
    HostInstant since;
    bool reported = false;
  };
  DurationNs patience_;
  std::map<std::uint32_t, Loose> loose_;
};

}  // namespace focalfleet
