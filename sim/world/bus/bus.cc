#include "sim/world/bus/bus.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/check.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet::sim {
namespace {

/// Transmit mailboxes of a unit's controller: what it keeps while it cannot send.
constexpr std::size_t kKeptMax = 3;

}  // namespace

Bus::Bus(const Options& options, Rng chance)
    : options_(options), chance_(chance), nodes_(1), idle_at_(options.start) {}

std::uint32_t Bus::Attach() {
  nodes_.emplace_back();
  ++hearing_;
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

DurationNs Bus::Bits(std::uint32_t bits) const { return BitTime(bits, options_.bit_rate_bps); }

// ---- what waits

bool Bus::Offer(const Waiting& waiting, HostInstant ready) {
  Entry entry{.ready = ready, .waiting = waiting};
  Node& node = nodes_[entry.node()];
  if (dead_ || (entry.node() == kHost && node.off)) {
    ++counters_.dropped;
    return false;
  }
  if (ready_.size() + later_.size() >= options_.mailboxes_max) {
    ++counters_.refused;
    return false;
  }
  entry.order = order_++;
  if (!Hears(entry.node())) {
    if (node.kept.size() >= kKeptMax) {
      ++counters_.refused;
      return false;
    }
    node.kept.push_back(entry);
    return true;
  }
  if (faults_.late > 0 && chance_.Uniform() < faults_.late) entry.ready = ready + faults_.late_by;
  Admit(entry);
  return true;
}

void Bus::Admit(const Entry& entry) {
  later_.push(entry);
  counters_.waiting_max =
      std::max(counters_.waiting_max, static_cast<std::uint32_t>(ready_.size() + later_.size()));
}

HostInstant Bus::NextEvent() const {
  if (dead_) return kNever;
  if (stuck_at_ != kNever) return stuck_step_at_;
  if (sending_) return idle_at_;
  const HostInstant begin = NextBegin();
  return off_nodes_.empty() ? begin : std::min(begin, NextRecovery());
}

HostInstant Bus::NextBegin() const {
  if (!ready_.empty() && held_until_ <= idle_at_) return std::max(idle_at_, ready_.top().ready);
  HostInstant at = kNever;
  if (!ready_.empty()) at = held_until_;
  if (!later_.empty()) at = std::min(at, std::max(idle_at_, later_.top().ready));
  for (const Babbler& babbler : babblers_) {
    if (!Hears(babbler.node)) continue;
    const HostInstant free =
        babbler.node == suspended_ ? std::max(idle_at_, suspended_until_) : idle_at_;
    at = std::min(at, std::max(free, babbler.since));
  }
  return at;
}

bool Bus::Advance(Heard* heard) {
  if (stuck_at_ != kNever) {
    StickOn(stuck_step_at_);
    return false;
  }
  if (!sending_) {
    if (!off_nodes_.empty() && NextRecovery() <= NextBegin()) {
      RecoverThrough(NextRecovery());
      return false;
    }
    BeginFrame(NextBegin());
    if (options_.bit_clock || !sending_) return false;
  }
  sending_ = false;
  return EndFrame(heard);
}

// ---- a frame begins

std::optional<Bus::Entry> Bus::TakeReady(HostInstant now) {
  while (!later_.empty() && later_.top().ready <= now) {
    ready_.push(later_.top());
    later_.pop();
  }
  if (ready_.empty()) return std::nullopt;
  // Suspend transmission: who sent last and is passive leaves the next eight bits to the others.
  std::vector<Entry> passed_over;
  std::optional<Entry> best;
  while (!best && !ready_.empty()) {
    if (now < suspended_until_ && ready_.top().node() == suspended_) {
      passed_over.push_back(ready_.top());
    } else {
      best = ready_.top();
    }
    ready_.pop();
  }
  for (const Entry& entry : passed_over) ready_.push(entry);
  return best;
}

std::optional<Bus::Entry> Bus::Arbitrate(HostInstant now) {
  std::optional<Entry> best = TakeReady(now);
  babbling_ = false;
  for (const Babbler& babbler : babblers_) {
    const bool suspended = babbler.node == suspended_ && now < suspended_until_;
    if (!Hears(babbler.node) || suspended || now < babbler.since) continue;
    if (best && best->waiting.frame.id <= babbler.frame.id) continue;
    if (best && !babbling_) ready_.push(*best);
    best = Entry{.ready = now, .waiting = {babbler.frame, babbler.node != kHost, babbler.node}};
    babbling_ = true;
  }
  return best;
}

void Bus::BeginFrame(HostInstant now) {
  const std::optional<Entry> best = Arbitrate(now);
  if (!best) {
    FOCALFLEET_CHECK(now < suspended_until_ && !ready_.empty());
    held_until_ = suspended_until_;
    return;
  }
  if (!off_nodes_.empty()) CountRowsWhileIdle(now);
  on_wire_ = *best;
  sending_ = true;
  abandoned_ = false;
  refusing_ = kNobody;
  counters_.idle = counters_.idle + (now - idle_at_);
  if (on_wire_.repeated) ++counters_.repeats;
  began_at_ = idle_at_ = now;
  course_ = DrawCourse();
  if (options_.bit_clock) idle_at_ = now + Bits(course_.bits);
}

/// The first disturbed bit is geometric: P(none in b bits) = (1 - rate)^b.
FrameCourse Bus::DrawCourse() {
  const CanFrame& frame = on_wire_.waiting.frame;
  const std::uint32_t sender = on_wire_.node();
  FrameCourse course;
  if (options_.bit_clock) course = hearing_ > 1 ? WellSent(frame) : Unacknowledged(frame);
  if (faults_.bit_error_rate > 0 && options_.bit_clock) {
    const double first =
        std::log1p(-chance_.Uniform()) / std::log1p(-std::min(faults_.bit_error_rate, 0.5));
    const std::uint32_t exposed = ExposedBits(frame);
    if (first < exposed) {
      const FrameCourse disturbed =
          DisturbedAt(frame, static_cast<std::uint32_t>(first),
                      nodes_[sender].errors.state() == Confinement::kPassive);
      if (course.accepted || disturbed.bits < course.bits) course = disturbed;
    }
  }
  if (faults_.duplicate > 0 && course.error == FrameError::kNone &&
      chance_.Uniform() < faults_.duplicate) {
    course = RefusedByOne(frame);
    if (!options_.bit_clock) course.bits = 0;
    if (hearing_ > 2) refusing_ = DrawReceiver(sender);
  }
  return course;
}

std::uint32_t Bus::DrawReceiver(std::uint32_t sender) {
  std::uint64_t skip = chance_.Below(hearing_ - 1);
  for (std::uint32_t node = 0;; ++node) {
    if (node == sender || !Hears(node)) continue;
    if (skip-- == 0) return node;
  }
}

// ---- a frame ends

bool Bus::EndFrame(Heard* heard) {
  Charge(idle_at_ - began_at_);
  const std::uint32_t sender = on_wire_.node();
  if (!off_nodes_.empty()) CountRowOfFrame();
  if (course_.error == FrameError::kNone) {
    counters_.bits += course_.bits;
    if (unclean_ > 0) CountWell(sender);
  } else {
    counters_.error_bits += course_.bits;
    ++counters_.errors[static_cast<std::size_t>(course_.error)];
    CountError(sender);
    if (course_.accepted) ++counters_.received_twice;
    if (!babbling_ && !abandoned_) {
      on_wire_.repeated = true;
      if (Hears(sender)) {
        ready_.push(on_wire_);
      } else if (sender != kHost) {
        nodes_[sender].kept.push_back(on_wire_);
      } else {
        ++counters_.dropped;
      }
    }
  }
  if (unclean_ > 0 && nodes_[sender].errors.state() == Confinement::kPassive) {
    suspended_ = sender;
    suspended_until_ = idle_at_ + Bits(kSuspendBits);
  }
  if (!off_nodes_.empty()) RecoverThrough(idle_at_);
  if (!course_.accepted) return false;
  heard->sent = on_wire_.waiting;
  heard->at = idle_at_;
  heard->but_not = refusing_;
  ++(heard->sent.from_unit ? counters_.unit_frames : counters_.host_frames);
  if (babbling_) ++counters_.babbled;
  heard->lost = faults_.drop > 0 && chance_.Uniform() < faults_.drop;
  if (heard->lost) ++counters_.dropped;
  return true;
}

void Bus::Charge(DurationNs taken) {
  counters_.busy = counters_.busy + taken;
  if (course_.error != FrameError::kNone) counters_.destroyed = counters_.destroyed + taken;
}

}  // namespace focalfleet::sim
