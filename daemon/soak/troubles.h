// Which parts of a simulated night an injected fault has touched, and until when. The judge excuses
// by it what no host could have prevented; nothing else is excused.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "protocol/base/instants.h"

namespace focalfleet::soak {

struct Troubles {
  static constexpr HostInstant kLongAgo{INT64_MIN};

  HostInstant host = kLongAgo;     // it was dead, frozen, or finding its feet until then
  HostInstant away = kLongAgo;     // the last instant at which it was dead or frozen
  HostInstant store = kLongAgo;    // the disk failed until then
  std::vector<HostInstant> buses;  // by index of the layout's buses
  std::vector<HostInstant> deaf;   // units that a stop does not reach
  std::vector<HostInstant> units;  // units that misbehave otherwise
  std::vector<std::vector<HostInstant>> jumps;  // power cuts: the rotor may jump by half a turn
  std::vector<HostInstant> counts_lost;  // FLASH had the counts of an earlier time from then on

  static void Until(HostInstant at, HostInstant* trouble) { *trouble = std::max(*trouble, at); }
};

}  // namespace focalfleet::soak
