#include "sim/world/bus/bus_nodes.h"

#include <algorithm>

#include "sim/world/bus/frame_course.h"

namespace focalfleet::sim {

std::uint32_t BusNodes::Attach() {
  nodes_.emplace_back();
  ++hearing_;
  return size() - 1;
}

std::uint32_t BusNodes::DrawReceiver(std::uint32_t sender, Rng* chance) const {
  std::uint64_t skip = chance->Below(hearing_ - 1);
  for (std::uint32_t node = 0;; ++node) {
    if (node == sender || !nodes_[node].hears()) continue;
    if (skip-- == 0) return node;
  }
}

// ---- presence

void BusNodes::PowerOff(std::uint32_t node) {
  Unplug(node);
  std::erase(off_, node);
  nodes_[node].off = false;
  Count(node, {}, [](ErrorCounters* errors) { errors->Recover(); });
}

bool BusNodes::PowerOn(std::uint32_t number) {
  BusNode& node = nodes_[number];
  if (node.there) return false;
  node.there = true;
  hearing_ += node.hears() ? 1u : 0u;
  return node.hears();
}

void BusNodes::Unplug(std::uint32_t number) {
  BusNode& node = nodes_[number];
  hearing_ -= node.hears() ? 1u : 0u;
  node.there = false;
}

bool BusNodes::Plug(std::uint32_t number, bool has_frames, HostInstant now) {
  BusNode& node = nodes_[number];
  if (node.there) return false;
  if (node.off) node.counts_from = std::max(node.counts_from, now);
  // Alone the node was not acknowledged: rule 3 up to passive, then exception 1.
  while (has_frames && node.errors.state() == Confinement::kActive)
    Count(number, now, [](ErrorCounters* errors) { errors->TransmitError(); });
  return PowerOn(number);
}

// ---- the way to bus-off and back

void BusNodes::GoOff(std::uint32_t number, HostInstant now) {
  BusNode& node = nodes_[number];
  hearing_ -= node.hears() ? 1u : 0u;
  node.off = true;
  node.rows_missing = kRecessiveRows;
  node.counts_from = now;
  if (number == kHostNode) {
    const bool waits = options_.host_restart == DurationNs{kNever.ns};
    node.counts_from = waits ? kNever : now + options_.host_restart;
  }
  off_.push_back(number);
  ++counters_.went_off;
}

void BusNodes::ThrowOff(std::uint32_t node, HostInstant now) {
  while (!nodes_[node].off)
    Count(node, now, [](ErrorCounters* errors) { errors->TransmitError(); });
}

void BusNodes::RestartHost(HostInstant now) {
  BusNode& host = nodes_[kHostNode];
  if (host.off) host.counts_from = std::min(host.counts_from, now);
}

HostInstant BusNodes::BackAt(const BusNode& node, HostInstant idle_at) const {
  if (node.counts_from == kNever || !node.there) return kNever;
  return std::max(idle_at, node.counts_from) + options_.Bits(node.rows_missing * kRecessiveRowBits);
}

HostInstant BusNodes::NextRecovery(HostInstant idle_at) const {
  HostInstant at = kNever;
  for (const std::uint32_t node : off_) at = std::min(at, BackAt(nodes_[node], idle_at));
  return at;
}

void BusNodes::CountRowsWhileIdle(HostInstant idle_at, HostInstant now) {
  const DurationNs row = options_.Bits(kRecessiveRowBits);
  for (const std::uint32_t number : off_) {
    BusNode& node = nodes_[number];
    const DurationNs seen = now - std::max(idle_at, node.counts_from);
    if (node.counts_from == kNever || seen < row) continue;
    node.rows_missing -= static_cast<std::uint32_t>(
        std::min<std::int64_t>(seen.ns / row.ns, std::int64_t{node.rows_missing}));
  }
}

void BusNodes::CountRowOfFrame(HostInstant idle_at) {
  const HostInstant row_began = idle_at - options_.Bits(kRecessiveRowBits);
  for (const std::uint32_t number : off_) {
    BusNode& node = nodes_[number];
    if (node.counts_from <= row_began && node.rows_missing > 0) --node.rows_missing;
  }
}

void BusNodes::CountRowsNotBefore(HostInstant now) {
  for (const std::uint32_t node : off_)
    nodes_[node].counts_from = std::max(nodes_[node].counts_from, now);
}

std::vector<std::uint32_t> BusNodes::TakeRecovered(HostInstant idle_at, HostInstant now) {
  std::vector<std::uint32_t> back;
  std::erase_if(off_, [&](std::uint32_t node) {
    if (BackAt(nodes_[node], idle_at) > now) return false;
    back.push_back(node);
    return true;
  });
  for (const std::uint32_t node : back) {
    nodes_[node].off = false;
    ++hearing_;  // a node that is away never comes back
    Count(node, now, [](ErrorCounters* errors) { errors->Recover(); });
  }
  counters_.recovered += back.size();
  return back;
}

}  // namespace focalfleet::sim
