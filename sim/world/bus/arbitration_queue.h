// The frames that wait for one bus. Among those that are ready the lowest identifier goes next.
// Equal identifiers go in order of coming, because only one node has that identifier.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet::sim {

inline constexpr std::uint32_t kHostNode = 0;
inline constexpr std::uint32_t kNoNode = UINT32_MAX;

struct WaitingFrame {
  CanFrame frame;
  bool from_unit = false;
  std::uint32_t sender = 0;  // node of the unit, or the host's client

  [[nodiscard]] std::uint32_t node() const { return from_unit ? sender : kHostNode; }
};

struct QueuedFrame {
  HostInstant ready;  // takes part in arbitration from then on
  std::uint64_t order = 0;
  WaitingFrame waiting;
  bool repeated = false;
  [[nodiscard]] std::uint32_t node() const { return waiting.node(); }
};

class ArbitrationQueue {
 public:
  /// The frame waits until it is ready.
  void Add(const QueuedFrame& entry) { later_.push(entry); }
  /// A frame that was ready before takes part in the next arbitration.
  void Return(const QueuedFrame& entry) { ready_.push(entry); }
  /// The frame that wins arbitration at `now`, taken out. Frames of `passed_over` stay. None: no
  /// other node has a frame that is ready.
  [[nodiscard]] std::optional<QueuedFrame> Take(HostInstant now, std::uint32_t passed_over);
  /// Moves all frames of `node` behind the end of `to`.
  void TakeAllOf(std::uint32_t node, std::vector<QueuedFrame>* to) {
    ready_.MoveAllOf(node, to);
    later_.MoveAllOf(node, to);
  }

  [[nodiscard]] std::size_t size() const { return ready_.size() + later_.size(); }
  [[nodiscard]] bool any_ready() const { return !ready_.empty(); }
  /// The instant at which the best of the ready frames became ready. Pre: any_ready().
  [[nodiscard]] HostInstant ready_since() const { return ready_.top().ready; }
  /// The instant at which the next of the other frames becomes ready; kNever: there are none.
  [[nodiscard]] HostInstant next_ready() const {
    return later_.empty() ? kNever : later_.top().ready;
  }

 private:
  struct LaterFirst {  // orders a heap whose top is ready soonest
    bool operator()(const QueuedFrame& a, const QueuedFrame& b) const {
      return a.ready != b.ready ? a.ready > b.ready : a.order > b.order;
    }
  };
  struct HigherFirst {  // orders a heap whose top wins arbitration
    bool operator()(const QueuedFrame& a, const QueuedFrame& b) const {
      return a.waiting.frame.id != b.waiting.frame.id ? a.waiting.frame.id > b.waiting.frame.id
                                                      : a.order > b.order;
    }
  };
  template <class Order>
  struct Heap : std::priority_queue<QueuedFrame, std::vector<QueuedFrame>, Order> {
    void MoveAllOf(std::uint32_t node, std::vector<QueuedFrame>* to);
    /// The first frame of any other node. Cost: linear; a node that is off may have hundreds.
    std::optional<QueuedFrame> TakeBestBut(std::uint32_t node);
  };

  Heap<LaterFirst> later_;
  Heap<HigherFirst> ready_;
};

template <class Order>
void ArbitrationQueue::Heap<Order>::MoveAllOf(std::uint32_t node, std::vector<QueuedFrame>* to) {
  std::vector<QueuedFrame>& all = this->c;
  const auto theirs = std::stable_partition(
      all.begin(), all.end(), [node](const QueuedFrame& entry) { return entry.node() != node; });
  to->insert(to->end(), theirs, all.end());
  all.erase(theirs, all.end());
  std::make_heap(all.begin(), all.end(), this->comp);
}

template <class Order>
std::optional<QueuedFrame> ArbitrationQueue::Heap<Order>::TakeBestBut(std::uint32_t node) {
  std::vector<QueuedFrame>& all = this->c;
  auto best = all.end();
  for (auto entry = all.begin(); entry != all.end(); ++entry)
    if (entry->node() != node && (best == all.end() || this->comp(*best, *entry))) best = entry;
  if (best == all.end()) return std::nullopt;
  const QueuedFrame taken = *best;
  *best = all.back();
  all.pop_back();
  std::make_heap(all.begin(), all.end(), this->comp);
  return taken;
}

}  // namespace focalfleet::sim
