#include "sim/world/bus/bus.h"

#include <algorithm>

namespace focalfleet::sim {

void Bus::RestartHost(HostInstant now) {
  BusNode& host = nodes_[kHost];
  if (host.off) host.counts_from = std::min(host.counts_from, now);
}

void Bus::ThrowHostOff(HostInstant now) {
  if (nodes_[kHost].off || dead_) return;
  if (on_wire_.sending && on_wire_.entry.node() == kHost) CutOff(kHost, now);
  while (!nodes_[kHost].off)
    Count(kHost, now, [](ErrorCounters* errors) { errors->TransmitError(); });
}

// ---- presence of nodes

/// The bits of the frame on the wire that are over at `now`. Pre: `now` is within the frame.
std::uint32_t Bus::BitsOnWire(HostInstant now) const {
  return static_cast<std::uint32_t>((now - on_wire_.began_at).ns * options_.bit_rate_bps /
                                    1'000'000'000);
}

/// The frame on the wire, if it is the node's own, ends here and is not sent again.
void Bus::CutOff(std::uint32_t node, HostInstant now) {
  if (!on_wire_.sending || on_wire_.entry.node() != node || on_wire_.abandoned) return;
  on_wire_.abandoned = true;
  const std::uint32_t at = BitsOnWire(now);
  if (on_wire_.course.error != FrameError::kNone || at >= ExposedBits(on_wire_.entry.waiting.frame))
    return;
  on_wire_.course = CutOffAt(on_wire_.entry.waiting.frame, at);
  idle_at_ = on_wire_.began_at + options_.Bits(on_wire_.course.bits);
  on_wire_.refusing = kNobody;
}

void Bus::PowerOff(std::uint32_t number, HostInstant now) {
  BusNode& node = nodes_[number];
  CutOff(number, now);
  nodes_.Leave(number);
  queue_.TakeAllOf(number, &node.kept);
  counters_.dropped += node.kept.size();
  node.kept.clear();
  nodes_.ClearOff(number);
  Count(number, now, [](ErrorCounters* errors) { errors->Recover(); });
}

void Bus::PowerOn(std::uint32_t number, HostInstant now) {
  if (nodes_[number].there) return;
  nodes_[number].there = true;
  Rejoin(number, now);
}

void Bus::Unplug(std::uint32_t number, HostInstant now) {
  BusNode& node = nodes_[number];
  if (!node.there) return;
  if (on_wire_.sending && on_wire_.entry.node() == number && !on_wire_.abandoned) {
    CutOff(number, now);
    if (!on_wire_.course.accepted) node.kept.push_back(on_wire_.entry);
  }
  nodes_.Leave(number);
  queue_.TakeAllOf(number, &node.kept);
  std::ranges::sort(node.kept, {}, &QueuedFrame::order);
}

void Bus::Plug(std::uint32_t number, HostInstant now) {
  BusNode& node = nodes_[number];
  if (node.there) return;
  node.there = true;
  if (node.off) node.counts_from = std::max(node.counts_from, now);
  // Alone the node was not acknowledged: rule 3 up to passive, then exception 1.
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
  if (on_wire_.sending) {
    on_wire_.course.error =
        on_wire_.course.error == FrameError::kNone ? FrameError::kForm : on_wire_.course.error;
    counters_.Charge(now - on_wire_.began_at, true);
  } else {
    counters_.idle = counters_.idle + std::max(now - idle_at_, DurationNs{0});
  }
  dead_at_ = on_wire_.sending ? now : std::max(now, idle_at_);
  queue_ = {};
  on_wire_.sending = false;
  dead_ = true;
}

void Bus::Revive(HostInstant now) {
  if (!dead_) return;
  dead_ = false;
  idle_at_ = std::max(now, dead_at_);
  counters_.dead = counters_.dead + (idle_at_ - dead_at_);
}

void Bus::Stick(HostInstant now) {
  if (dead_ || stuck_.at != kNever || !options_.bit_clock) return;
  stuck_.sender = kNobody;
  stuck_.at = now;
  if (on_wire_.sending) {
    // From here on the sender sees other levels than it drives; its frame is repeated later.
    stuck_.sender = on_wire_.abandoned ? kNobody : on_wire_.entry.node();
    on_wire_.course.error = FrameError::kBit;
    ++counters_.errors[static_cast<std::size_t>(FrameError::kBit)];
    counters_.error_bits += BitsOnWire(now);
    counters_.Charge(now - on_wire_.began_at, true);
    if (!on_wire_.abandoned && !on_wire_.babbling) {
      on_wire_.entry.repeated = true;
      queue_.Return(on_wire_.entry);
    }
    on_wire_.sending = false;
  } else {
    if (nodes_.any_off()) nodes_.CountRowsWhileIdle(idle_at_, now);
    counters_.idle = counters_.idle + std::max(now - idle_at_, DurationNs{0});
    stuck_.at = std::max(now, idle_at_);
  }
  idle_at_ = stuck_.at;
  stuck_.steps = 0;
  stuck_.step_at = stuck_.at + options_.Bits(kFlagBits);
}

void Bus::Release(HostInstant now) {
  if (stuck_.at == kNever) return;
  // All nodes wait for the end of the error frame that they see.
  idle_at_ = std::max(now, stuck_.at) + options_.Bits(kDelimiterBits + kIntermissionBits);
  counters_.stuck = counters_.stuck + (idle_at_ - stuck_.at);
  counters_.busy = counters_.busy + (idle_at_ - stuck_.at);
  stuck_.at = stuck_.step_at = kNever;
  stuck_.sender = kNobody;
  nodes_.CountRowsNotBefore(now);
}

}  // namespace focalfleet::sim
