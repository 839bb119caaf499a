// What a bus does when something is wrong: counters, controllers that go off and come back, nodes
// that leave, a wire that is dead or stuck. A frame's usual way is in bus.cc.
#include <algorithm>

#include "sim/world/bus/bus.h"

namespace focalfleet::sim {

template <class Order>
void Bus::Heap<Order>::MoveAllOf(std::uint32_t node, std::vector<Entry>* to) {
  std::vector<Entry>& all = this->c;
  const auto theirs = std::stable_partition(
      all.begin(), all.end(), [node](const Entry& entry) { return entry.node() != node; });
  to->insert(to->end(), theirs, all.end());
  all.erase(theirs, all.end());
  std::make_heap(all.begin(), all.end(), this->comp);
}

// ---- counters (the rules' numbers: error_counters.h)

template <class Change>
void Bus::Count(std::uint32_t node, HostInstant now, const Change& change) {
  ErrorCounters& errors = nodes_[node].errors;
  const bool was_clean = errors.clean();
  const Confinement before = errors.state();
  change(&errors);
  if (was_clean != errors.clean()) unclean_ += was_clean ? 1u : UINT32_MAX;
  const Confinement after = errors.state();
  if (before == Confinement::kActive && after == Confinement::kPassive) ++counters_.went_passive;
  if (after == Confinement::kOff && !nodes_[node].off) GoOff(node, now);
}

void Bus::CountWell(std::uint32_t sender) {
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node) || nodes_[node].errors.clean()) continue;
    Count(node, idle_at_, [&](ErrorCounters* errors) {
      node == sender ? errors->Transmitted() : errors->Received();
    });
  }
}

void Bus::CountError(std::uint32_t sender) {
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node)) continue;
    if (node == sender && !course_.lost_arbitration) {
      const bool passive = nodes_[node].errors.state() == Confinement::kPassive;
      if (abandoned_ || course_.excused || (course_.unanswered && passive)) continue;
      Count(node, idle_at_, [](ErrorCounters* errors) { errors->TransmitError(); });
    } else if (node == refusing_) {
      // Its flag begins one bit before the others' and ends one bit before theirs.
      Count(node, idle_at_, [](ErrorCounters* errors) {
        errors->ReceiveError();
        errors->DominantBehindFlag();
      });
    } else if (!course_.accepted) {
      Count(node, idle_at_, [](ErrorCounters* errors) { errors->ReceiveError(); });
    }
  }
}

// ---- off, and back

void Bus::GoOff(std::uint32_t node, HostInstant now) {
  Node& off = nodes_[node];
  off.off = true;
  off.rows_missing = kRecessiveRows;
  const bool waits = node == kHost && options_.host_restart == DurationNs{kNever.ns};
  off.counts_from = waits ? kNever : node == kHost ? now + options_.host_restart : now;
  off_nodes_.push_back(node);
  ++counters_.went_off;
  hearing_ -= off.there ? 1u : 0u;
  ready_.MoveAllOf(node, &off.kept);
  later_.MoveAllOf(node, &off.kept);
  if (node != kHost) return;
  counters_.dropped += off.kept.size();  // as a driver does with what it holds
  off.kept.clear();
}

HostInstant Bus::BackAt(const Node& node) const {
  if (node.counts_from == kNever || !node.there) return kNever;
  return std::max(idle_at_, node.counts_from) + Bits(node.rows_missing * kRecessiveRowBits);
}

HostInstant Bus::NextRecovery() const {
  HostInstant at = kNever;
  for (const std::uint32_t node : off_nodes_) at = std::min(at, BackAt(nodes_[node]));
  return at;
}

void Bus::CountRowsWhileIdle(HostInstant now) {
  const std::int64_t row_ns = Bits(kRecessiveRowBits).ns;
  for (const std::uint32_t number : off_nodes_) {
    Node& node = nodes_[number];
    const DurationNs seen = now - std::max(idle_at_, node.counts_from);
    if (node.counts_from == kNever || seen.ns < row_ns) continue;
    node.rows_missing -= static_cast<std::uint32_t>(
        std::min<std::int64_t>(seen.ns / row_ns, std::int64_t{node.rows_missing}));
  }
}

void Bus::CountRowOfFrame() {
  const HostInstant row_began = idle_at_ - Bits(kRecessiveRowBits);
  for (const std::uint32_t number : off_nodes_) {
    Node& node = nodes_[number];
    if (node.counts_from <= row_began && node.rows_missing > 0) --node.rows_missing;
  }
}

void Bus::RecoverThrough(HostInstant now) {
  for (std::size_t i = 0; i < off_nodes_.size();) {
    const std::uint32_t number = off_nodes_[i];
    if (BackAt(nodes_[number]) > now) {
      ++i;
      continue;
    }
    off_nodes_.erase(off_nodes_.begin() + static_cast<std::ptrdiff_t>(i));
    nodes_[number].off = false;
    Count(number, now, [](ErrorCounters* errors) { errors->Recover(); });
    ++counters_.recovered;
    Rejoin(number, now);
  }
}

void Bus::RestartHost(HostInstant now) {
  Node& host = nodes_[kHost];
  if (host.off) host.counts_from = std::min(host.counts_from, now);
}

void Bus::ThrowHostOff(HostInstant now) {
  if (nodes_[kHost].off || dead_) return;
  if (sending_ && on_wire_.node() == kHost) Leave(kHost, now);
  while (!nodes_[kHost].off)
    Count(kHost, now, [](ErrorCounters* errors) { errors->TransmitError(); });
}

// ---- who is there

/// `now` is within the frame on the wire: bits of it that are over.
std::uint32_t Bus::BitsOnWire(HostInstant now) const {
  return static_cast<std::uint32_t>((now - began_at_).ns * options_.bit_rate_bps / 1'000'000'000);
}

/// Its frame on the wire, if it is its own, ends here and is not sent again.
void Bus::Leave(std::uint32_t node, HostInstant now) {
  if (!sending_ || on_wire_.node() != node || abandoned_) return;
  abandoned_ = true;
  const std::uint32_t at = BitsOnWire(now);
  if (course_.error != FrameError::kNone || at >= ExposedBits(on_wire_.waiting.frame)) return;
  course_ = CutOffAt(on_wire_.waiting.frame, at);
  idle_at_ = began_at_ + Bits(course_.bits);
  refusing_ = kNobody;
}

void Bus::Rejoin(std::uint32_t number, HostInstant now) {
  Node& node = nodes_[number];
  if (!Hears(number)) return;
  ++hearing_;
  for (Babbler& babbler : babblers_)
    if (babbler.node == number) babbler.since = std::max(babbler.since, now);
  for (Entry& entry : node.kept) {
    entry.ready = std::max(entry.ready, now);
    Admit(entry);
  }
  node.kept.clear();
}

void Bus::PowerOff(std::uint32_t number, HostInstant now) {
  Node& node = nodes_[number];
  Leave(number, now);
  hearing_ -= Hears(number) ? 1u : 0u;
  node.there = false;
  ready_.MoveAllOf(number, &node.kept);
  later_.MoveAllOf(number, &node.kept);
  counters_.dropped += node.kept.size();
  node.kept.clear();
  std::erase(off_nodes_, number);
  node.off = false;
  Count(number, now, [](ErrorCounters* errors) { errors->Recover(); });
}

void Bus::PowerOn(std::uint32_t number, HostInstant now) {
  if (nodes_[number].there) return;
  nodes_[number].there = true;
  Rejoin(number, now);
}

void Bus::Unplug(std::uint32_t number, HostInstant now) {
  Node& node = nodes_[number];
  if (!node.there) return;
  if (sending_ && on_wire_.node() == number && !abandoned_) {
    Leave(number, now);
    if (!course_.accepted) node.kept.push_back(on_wire_);
  }
  hearing_ -= Hears(number) ? 1u : 0u;
  node.there = false;
  ready_.MoveAllOf(number, &node.kept);
  later_.MoveAllOf(number, &node.kept);
  std::ranges::sort(node.kept, {}, &Entry::order);
}

void Bus::Plug(std::uint32_t number, HostInstant now) {
  Node& node = nodes_[number];
  if (node.there) return;
  node.there = true;
  if (node.off) node.counts_from = std::max(node.counts_from, now);
  // Alone it was not acknowledged: rule 3 up to passive, then exception 1.
  while (!node.kept.empty() && node.errors.state() == Confinement::kActive)
    Count(number, now, [](ErrorCounters* errors) { errors->TransmitError(); });
  Rejoin(number, now);
}

void Bus::Babble(std::uint32_t node, const std::optional<CanFrame>& frame, HostInstant now) {
  std::erase_if(babblers_, [node](const Babbler& babbler) { return babbler.node == node; });
  if (frame) babblers_.push_back({node, *frame, now});
}

// ---- a wire that is dead or stuck

void Bus::Kill(HostInstant now) {
  if (dead_) return;
  Release(now);
  counters_.dropped += waiting();
  if (sending_) {
    course_.error = course_.error == FrameError::kNone ? FrameError::kForm : course_.error;
    Charge(now - began_at_);
  } else {
    counters_.idle = counters_.idle + std::max(now - idle_at_, DurationNs{0});
  }
  dead_at_ = sending_ ? now : std::max(now, idle_at_);
  later_ = {};
  ready_ = {};
  sending_ = false;
  dead_ = true;
}

void Bus::Revive(HostInstant now) {
  if (!dead_) return;
  dead_ = false;
  idle_at_ = std::max(now, dead_at_);
  counters_.dead = counters_.dead + (idle_at_ - dead_at_);
}

void Bus::Stick(HostInstant now) {
  if (dead_ || stuck_at_ != kNever || !options_.bit_clock) return;
  stuck_sender_ = kNobody;
  stuck_at_ = now;
  if (sending_) {
    // From here on the sender sees what it does not send; its frame comes later.
    stuck_sender_ = abandoned_ ? kNobody : on_wire_.node();
    course_.error = FrameError::kBit;
    ++counters_.errors[static_cast<std::size_t>(FrameError::kBit)];
    counters_.error_bits += BitsOnWire(now);
    Charge(now - began_at_);
    if (!abandoned_ && !babbling_) {
      on_wire_.repeated = true;
      ready_.push(on_wire_);
    }
    sending_ = false;
  } else {
    if (!off_nodes_.empty()) CountRowsWhileIdle(now);
    counters_.idle = counters_.idle + std::max(now - idle_at_, DurationNs{0});
    stuck_at_ = std::max(now, idle_at_);
  }
  idle_at_ = stuck_at_;
  stuck_steps_ = 0;
  stuck_step_at_ = stuck_at_ + Bits(kFlagBits);
}

/// A dominant wire, as the nodes see it: the sixth equal bit is an error (rules 1 and 3), their
/// flag takes six, the bit behind it is dominant (rule 2), and so are the eight behind it, and the
/// eight behind these (rule 6), until nobody has anything left to lose.
void Bus::StickOn(HostInstant now) {
  bool all_passive = true;
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node)) continue;
    const bool sends = node == stuck_sender_;
    Count(node, now, [&](ErrorCounters* errors) {
      if (!sends) {
        stuck_steps_ == 0 ? errors->ReceiveError() : errors->DominantBehindFlag();
      } else if (stuck_steps_ != 1) {
        errors->TransmitError();
      }
    });
    all_passive = all_passive && !sends && state(node) != Confinement::kActive;
  }
  stuck_step_at_ = all_passive ? kNever : now + Bits(stuck_steps_ < 2 ? kFlagBits + 1 : 8);
  ++stuck_steps_;
}

void Bus::Release(HostInstant now) {
  if (stuck_at_ == kNever) return;
  // All wait for the end of the error frame that they see.
  idle_at_ = std::max(now, stuck_at_) + Bits(kDelimiterBits + kIntermissionBits);
  counters_.stuck = counters_.stuck + (idle_at_ - stuck_at_);
  counters_.busy = counters_.busy + (idle_at_ - stuck_at_);
  stuck_at_ = stuck_step_at_ = kNever;
  stuck_sender_ = kNobody;
  for (const std::uint32_t node : off_nodes_)
    nodes_[node].counts_from = std::max(nodes_[node].counts_from, now);
}

}  // namespace focalfleet::sim
