// The contest for the wire of one bus: the frames that wait, nodes that babble, and the pause that
// a passive sender makes. When the wire falls idle, the lowest identifier goes next. The frames of
// a node that cannot send stay in its mailboxes until it can.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "sim/world/bus/arbitration_queue.h"
#include "sim/world/bus/bus_counters.h"
#include "sim/world/bus/bus_nodes.h"

namespace focalfleet::sim {

class Arbitration {
 public:
  explicit Arbitration(std::uint32_t mailboxes_max) : mailboxes_max_(mailboxes_max) {}

  // ---- frames that wait

  /// A frame of `node` that is offered now takes part in arbitration.
  [[nodiscard]] bool TakesPart(const BusNode& node) const {
    return node.hears() && queue_.size() < mailboxes_max_;
  }
  /// `waiting` takes part in arbitration from `ready` on, or stays in a mailbox of a node that
  /// cannot send. False: no mailbox is left, or the host's controller is off.
  bool Offer(const WaitingFrame& waiting, HostInstant ready, const BusNodes& nodes);
  /// `entry` did not get through and is sent again.
  void Repeat(QueuedFrame entry, const BusNodes& nodes);
  /// The frames of `node`, which cannot send, stay in its mailboxes. The driver of a host that is
  /// off drops its frames instead.
  void Hold(std::uint32_t node);
  /// `entry` stays in the mailboxes of its sender, which cannot send.
  void Hold(const QueuedFrame& entry) { held_[entry.node()].push_back(entry); }
  /// `node` can send again, from `now` on.
  void LetIn(std::uint32_t node, HostInstant now);
  void DropAllOf(std::uint32_t node);
  /// Drops all frames that take part in arbitration.
  void DropAll();
  /// A frame that no longer waits was lost.
  void CountDropped() { ++counters_.dropped; }
  /// A mailbox of `node`, which cannot send, has a frame.
  [[nodiscard]] bool holds(std::uint32_t node) const { return held_.contains(node); }
  /// The number of frames that take part in arbitration.
  [[nodiscard]] std::size_t waiting() const { return queue_.size(); }
  [[nodiscard]] const MailboxCounters& counters() const { return counters_; }

  // ---- disturbed contests

  /// `node` sends `frame` from `now` on whenever arbitration lets it; none: no more.
  void Babble(std::uint32_t node, const std::optional<CanFrame>& frame, HostInstant now);
  /// A passive `node`, which sent last, leaves the wire to the others until `until`.
  void Suspend(std::uint32_t node, HostInstant until);

  // ---- the next frame

  /// The instant at which the next frame can begin on a wire that is idle from `idle_at` on.
  [[nodiscard]] HostInstant NextBegin(const BusNodes& nodes, HostInstant idle_at) const;

  struct Winner {
    QueuedFrame entry;
    bool babbling = false;
  };
  /// The frame that wins arbitration at `now`, taken out; none: only a suspended node has any.
  [[nodiscard]] std::optional<Winner> Take(const BusNodes& nodes, HostInstant now);

 private:
  struct Suspension {
    std::uint32_t node = kNoNode;  // sent the last frame and is passive
    HostInstant until{0};
    HostInstant held_until{0};  // until then only the suspended node has a ready frame
  };
  struct Babbler {
    std::uint32_t node;
    CanFrame frame;
    HostInstant since;
  };

  void Admit(const QueuedFrame& entry);

  std::uint32_t mailboxes_max_;
  MailboxCounters counters_;
  ArbitrationQueue queue_;
  std::map<std::uint32_t, std::vector<QueuedFrame>> held_;  // by node; none is empty
  std::uint64_t order_ = 0;
  std::vector<Babbler> babblers_;
  Suspension suspended_;
};

}  // namespace focalfleet::sim
