#include "daemon/metrics/metric_groups.h"

#include <algorithm>

namespace focalfleet {
namespace {

void AddTo(BusMetrics* all, const BusMetrics& bus) {
  all->units += bus.units;
  all->answering += bus.answering;
  all->link = std::max(all->link, bus.link);  // states are in the order of their badness
  all->load = std::max(all->load, bus.load);
  all->frames_sent += bus.frames_sent;
  all->frames_received += bus.frames_received;
  all->retransmits += bus.retransmits;
  all->errors += bus.errors;
  all->waiting = std::max(all->waiting, bus.waiting);
  all->clock_bound_s = std::max(all->clock_bound_s, bus.clock_bound_s);
}

void AddTo(RailMetrics* all, const RailMetrics& rail) {
  all->units += rail.units;
  all->answering += rail.answering;
  all->power_predicted_W += rail.power_predicted_W;
}

std::string LabelOf(const BusMetrics& bus) { return std::to_string(bus.bus.value); }
std::string LabelOf(const RailMetrics& rail) { return std::to_string(rail.rail.value); }

template <class Group, class Member>
std::vector<Group> GroupsOf(const std::vector<Member>& members, std::size_t groups_max) {
  std::vector<Group> groups;
  const std::size_t size = (members.size() + groups_max - 1) / groups_max;
  for (std::size_t begin = 0; begin < members.size(); begin += size) {
    const std::size_t end = std::min(begin + size, members.size());
    Group group{LabelOf(members[begin]), members[begin]};
    for (std::size_t i = begin + 1; i < end; ++i) AddTo(&group.all, members[i]);
    if (end - begin > 1) group.label += "-" + LabelOf(members[end - 1]);
    groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace

std::vector<BusGroup> GroupBuses(const std::vector<BusMetrics>& buses) {
  return GroupsOf<BusGroup>(buses, kBusGroupsMax);
}

std::vector<RailGroup> GroupRails(const std::vector<RailMetrics>& rails) {
  return GroupsOf<RailGroup>(rails, kRailGroupsMax);
}

}  // namespace focalfleet
