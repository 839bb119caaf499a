#include "sim/world/bus/bus_nodes.h"

#include <algorithm>

#include "protocol/wire/frame_bits.h"
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
    if (node == sender || !Hears(node)) continue;
    if (skip-- == 0) return node;
  }
}

void BusNodes::GoOff(std::uint32_t node, HostInstant counts_from) {
  BusNode& off = nodes_[node];
  off.off = true;
  off.rows_missing = kRecessiveRows;
  off.counts_from = counts_from;
  off_.push_back(node);
  hearing_ -= off.there ? 1u : 0u;
}

void BusNodes::Leave(std::uint32_t node) {
  hearing_ -= Hears(node) ? 1u : 0u;
  nodes_[node].there = false;
}

void BusNodes::ClearOff(std::uint32_t node) {
  std::erase(off_, node);
  nodes_[node].off = false;
}

DurationNs BusNodes::Rows(std::uint32_t count) const {
  return BitTime(count * kRecessiveRowBits, bit_rate_bps_);
}

HostInstant BusNodes::BackAt(const BusNode& node, HostInstant idle_at) const {
  if (node.counts_from == kNever || !node.there) return kNever;
  return std::max(idle_at, node.counts_from) + Rows(node.rows_missing);
}

HostInstant BusNodes::NextRecovery(HostInstant idle_at) const {
  HostInstant at = kNever;
  for (const std::uint32_t node : off_) at = std::min(at, BackAt(nodes_[node], idle_at));
  return at;
}

void BusNodes::CountRowsWhileIdle(HostInstant idle_at, HostInstant now) {
  const DurationNs row = Rows(1);
  for (const std::uint32_t number : off_) {
    BusNode& node = nodes_[number];
    const DurationNs seen = now - std::max(idle_at, node.counts_from);
    if (node.counts_from == kNever || seen < row) continue;
    node.rows_missing -= static_cast<std::uint32_t>(
        std::min<std::int64_t>(seen.ns / row.ns, std::int64_t{node.rows_missing}));
  }
}

void BusNodes::CountRowOfFrame(HostInstant idle_at) {
  const HostInstant row_began = idle_at - Rows(1);
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
  for (const std::uint32_t node : back) nodes_[node].off = false;
  return back;
}

}  // namespace focalfleet::sim
