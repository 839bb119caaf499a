// Groups are the units on one supply rail, or on one CAN bus. All units of a rail or a bus have its
// effect, or none of them does.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/campaigns/diagnosis/model/model.h"
#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

struct FleetGroups {
  std::vector<std::uint32_t> rail;  // Shape: (units); kNoGroup where unknown
  std::vector<std::uint32_t> bus;
  std::size_t rails = 0;  // 0: unknown, or one
  std::size_t buses = 0;
};
FleetGroups GroupsOf(const CampaignFacts& facts);

/// Groups of units that have an effect of this owner together, whatever its amplitude in each.
/// Empty: each unit by itself. Where no rail or bus is known, the fleet is one group.
/// Shape: (units).
std::vector<std::uint32_t> Together(Owner owner, const FleetGroups& groups, std::size_t units);

/// Whether the units with this flag can have an effect of such an owner. Most units of each rail,
/// or bus, that has any such unit must have it. Shape of has: (units).
bool AreTogether(Owner owner, const std::vector<char>& has, const FleetGroups& groups);

}  // namespace focalfleet::sim
