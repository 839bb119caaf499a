#include "sim/world/bus/arbitration.h"

#include <algorithm>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

/// The transmit mailboxes of a unit's controller, which hold frames while it cannot send.
constexpr std::size_t kHeldMax = 3;

}  // namespace

// ---- frames that wait

bool Arbitration::Offer(const WaitingFrame& waiting, HostInstant ready, const BusNodes& nodes) {
  QueuedFrame entry{.ready = ready, .waiting = waiting};
  const std::uint32_t number = entry.node();
  const BusNode& node = nodes[number];
  if (number == kHostNode && node.off) {
    ++counters_.dropped;
    return false;
  }
  if (queue_.size() >= mailboxes_max_) {
    ++counters_.refused;
    return false;
  }
  entry.order = order_++;
  if (node.hears()) {
    Admit(entry);
    return true;
  }
  const auto held = held_.find(number);
  if (held != held_.end() && held->second.size() >= kHeldMax) {
    ++counters_.refused;
    return false;
  }
  Hold(entry);
  return true;
}

void Arbitration::Admit(const QueuedFrame& entry) {
  queue_.Add(entry);
  counters_.waiting_max =
      std::max(counters_.waiting_max, static_cast<std::uint32_t>(queue_.size()));
}

void Arbitration::Repeat(QueuedFrame entry, const BusNodes& nodes) {
  entry.repeated = true;
  if (nodes[entry.node()].hears()) {
    queue_.Return(entry);
  } else if (entry.node() != kHostNode) {
    Hold(entry);
  } else {
    ++counters_.dropped;
  }
}

void Arbitration::Hold(std::uint32_t node) {
  if (node == kHostNode) {
    DropAllOf(node);
    return;
  }
  std::vector<QueuedFrame> frames;
  queue_.TakeAllOf(node, &frames);
  for (const QueuedFrame& entry : frames) Hold(entry);
}

void Arbitration::LetIn(std::uint32_t node, HostInstant now) {
  for (Babbler& babbler : babblers_)
    if (babbler.node == node) babbler.since = std::max(babbler.since, now);
  const auto held = held_.find(node);
  if (held == held_.end()) return;
  for (QueuedFrame& entry : held->second) {
    entry.ready = std::max(entry.ready, now);
    Admit(entry);
  }
  held_.erase(held);
}

void Arbitration::DropAllOf(std::uint32_t node) {
  std::vector<QueuedFrame>& frames = held_[node];
  queue_.TakeAllOf(node, &frames);
  counters_.dropped += frames.size();
  held_.erase(node);
}

void Arbitration::DropAll() {
  counters_.dropped += queue_.size();
  queue_ = {};
}

// ---- disturbed contests

void Arbitration::Babble(std::uint32_t node, const std::optional<CanFrame>& frame,
                         HostInstant now) {
  std::erase_if(babblers_, [node](const Babbler& babbler) { return babbler.node == node; });
  if (frame) babblers_.push_back({node, *frame, now});
}

void Arbitration::Suspend(std::uint32_t node, HostInstant until) {
  suspended_.node = node;
  suspended_.until = until;
}

// ---- the next frame

HostInstant Arbitration::NextBegin(const BusNodes& nodes, HostInstant idle_at) const {
  if (queue_.any_ready() && suspended_.held_until <= idle_at)
    return std::max(idle_at, queue_.ready_since());
  HostInstant at = kNever;
  if (queue_.any_ready()) at = suspended_.held_until;
  at = std::min(at, std::max(idle_at, queue_.next_ready()));
  for (const Babbler& babbler : babblers_) {
    if (!nodes[babbler.node].hears()) continue;
    const HostInstant free =
        babbler.node == suspended_.node ? std::max(idle_at, suspended_.until) : idle_at;
    at = std::min(at, std::max(free, babbler.since));
  }
  return at;
}

std::optional<Arbitration::Winner> Arbitration::Take(const BusNodes& nodes, HostInstant now) {
  // Suspend transmission: a passive node that sent last leaves the next eight bits to the others.
  const std::uint32_t suspended = now < suspended_.until ? suspended_.node : kNoNode;
  std::optional<Winner> best;
  if (const std::optional<QueuedFrame> entry = queue_.Take(now, suspended))
    best = Winner{.entry = *entry};
  for (const Babbler& babbler : babblers_) {
    if (!nodes[babbler.node].hears() || babbler.node == suspended || now < babbler.since) continue;
    if (best && best->entry.waiting.frame.id <= babbler.frame.id) continue;
    if (best && !best->babbling) queue_.Return(best->entry);
    const WaitingFrame waiting{babbler.frame, babbler.node != kHostNode, babbler.node};
    best = Winner{.entry = {.ready = now, .waiting = waiting}, .babbling = true};
  }
  if (!best) {
    FOCALFLEET_CHECK(now < suspended_.until && queue_.any_ready());
    suspended_.held_until = suspended_.until;
  }
  return best;
}

}  // namespace focalfleet::sim
