// Which units hang together: on one supply rail, on one CAN bus. What a rail or a bus owns comes to
// its units together or to none of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/campaigns/diagnosis/model.h"
#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

struct FleetGroups {
  std::vector<std::uint32_t> rail;  // Shape: (units); kNoGroup where unknown
  std::vector<std::uint32_t> bus;
  std::size_t rails = 0;  // 0: unknown, or one
  std::size_t buses = 0;
};
FleetGroups GroupsOf(const CampaignFacts& facts);

/// Shape: (units): who has an effect of this owner together, whatever each has of it. Empty: each
/// by itself. Where no rail or bus is known, the fleet is one.
std::vector<std::uint32_t> Together(Owner owner, const FleetGroups& groups, std::size_t units);

/// Can units with this flag have what such an owner has? A rail's units, and a bus', have it
/// together: most of those of each that has any. Shape of has: (units).
bool AreTogether(Owner owner, const std::vector<char>& has, const FleetGroups& groups);

}  // namespace focalfleet::sim
