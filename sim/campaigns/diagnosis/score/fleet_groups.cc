#include "sim/campaigns/diagnosis/score/fleet_groups.h"

#include <algorithm>
#include <map>
#include <span>

namespace focalfleet::sim {
namespace {

std::vector<std::uint32_t> Numbered(std::span<const double> ids, std::span<const std::size_t> first,
                                    std::size_t* groups) {
  std::map<double, std::uint32_t> number;
  std::vector<std::uint32_t> of;
  for (std::size_t unit = 0; unit + 1 < first.size(); ++unit) {
    if (first[unit] == first[unit + 1]) {
      of.push_back(kNoGroup);
      continue;
    }
    const auto [it, fresh] =
        number.emplace(ids[first[unit]], static_cast<std::uint32_t>(number.size()));
    of.push_back(it->second);
  }
  *groups = number.size();
  return of;
}

}  // namespace

FleetGroups GroupsOf(const CampaignFacts& facts) {
  FleetGroups groups;
  const Campaign& campaign = *facts.campaign;
  if (const FilledColumn* rail = facts.Find("rail_id"))
    groups.rail = Numbered(rail->values, campaign.first_row, &groups.rails);
  if (const FilledColumn* bus = facts.Find("bus_id"))
    groups.bus = Numbered(bus->values, campaign.first_row, &groups.buses);
  if (groups.rails < 2) groups.rails = 0;
  if (groups.buses < 2) groups.buses = 0;
  return groups;
}

std::vector<std::uint32_t> Together(Owner owner, const FleetGroups& groups, std::size_t units) {
  if (owner == Owner::kRail)
    return groups.rails > 0 ? groups.rail : std::vector<std::uint32_t>(units, 0);
  if (owner == Owner::kBus)
    return groups.buses > 0 ? groups.bus : std::vector<std::uint32_t>(units, 0);
  return {};
}

bool AreTogether(Owner owner, const std::vector<char>& has, const FleetGroups& groups) {
  const std::vector<std::uint32_t> group_of = Together(owner, groups, has.size());
  struct Count {
    std::size_t have = 0, all = 0;
  };
  std::map<std::uint32_t, Count> counts;
  for (std::size_t unit = 0; unit < group_of.size(); ++unit) {
    Count& count = counts[group_of[unit]];
    ++count.all;
    if (has[unit] != 0) ++count.have;
  }
  return std::none_of(counts.begin(), counts.end(), [](const auto& entry) {
    return entry.second.have > 0 && 2 * entry.second.have < entry.second.all;
  });
}

}  // namespace focalfleet::sim
