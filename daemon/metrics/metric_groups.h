// Groups keep the number of series bounded, whatever the plate. A plate has a group for each bus
// and each rail, as long as these are few. Where there are more, neighbours in the order of their
// numbers share a group, and its label is their range: bus="5-8". Counts of a group are sums; a
// load, a queue, a bound and a state are those of its worst member, so that an alert on them still
// fires.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/metrics/fleet_metrics.h"

namespace focalfleet {

// Fifty buses have 13 series each and forty rails 3: with some 200 others that is less than the
// thousand that a small Prometheus keeps for years. Half of the numbers halves what an operator can
// tell apart; twice of them doubles the page.
inline constexpr std::size_t kBusGroupsMax = 50;
inline constexpr std::size_t kRailGroupsMax = 40;

struct BusGroup {
  std::string label;  // "5", or "5-8"
  BusMetrics all;     // its `bus` is the first of the group
};

struct RailGroup {
  std::string label;
  RailMetrics all;
};

/// At most kBusGroupsMax groups, in the order of the buses.
std::vector<BusGroup> GroupBuses(const std::vector<BusMetrics>& buses);
/// At most kRailGroupsMax groups, in the order of the rails. Powers are sums.
std::vector<RailGroup> GroupRails(const std::vector<RailMetrics>& rails);

}  // namespace focalfleet
