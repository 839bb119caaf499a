#include "sim/world/bus/traffic.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

/// The transmit mailboxes of a unit's controller, which hold frames while it cannot send.
constexpr std::size_t kKeptMax = 3;

}  // namespace

BusTraffic::BusTraffic(const Options& options, Rng chance)
    : options_(options), chance_(chance), nodes_(options.bit_rate_bps), idle_at_(options.start) {}

std::uint32_t BusTraffic::Attach() { return nodes_.Attach(); }

// ---- frames that wait

bool BusTraffic::Offer(const Waiting& waiting, HostInstant ready) {
  QueuedFrame entry{.ready = ready, .waiting = waiting};
  BusNode& node = nodes_[entry.node()];
  if (dead_ || (entry.node() == kHost && node.off)) {
    ++counters_.dropped;
    return false;
  }
  if (queue_.size() >= options_.mailboxes_max) {
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

void BusTraffic::Admit(const QueuedFrame& entry) {
  queue_.Add(entry);
  counters_.waiting_max =
      std::max(counters_.waiting_max, static_cast<std::uint32_t>(queue_.size()));
}

HostInstant BusTraffic::NextEvent() const {
  if (dead_) return kNever;
  if (stuck_.at != kNever) return stuck_.step_at;
  if (on_wire_.sending) return idle_at_;
  const HostInstant begin = NextBegin();
  return !nodes_.any_off() ? begin : std::min(begin, nodes_.NextRecovery(idle_at_));
}

HostInstant BusTraffic::NextBegin() const {
  if (queue_.any_ready() && suspended_.held_until <= idle_at_)
    return std::max(idle_at_, queue_.ready_since());
  HostInstant at = kNever;
  if (queue_.any_ready()) at = suspended_.held_until;
  at = std::min(at, std::max(idle_at_, queue_.next_ready()));
  for (const Babbler& babbler : babblers_) {
    if (!Hears(babbler.node)) continue;
    const HostInstant free =
        babbler.node == suspended_.node ? std::max(idle_at_, suspended_.until) : idle_at_;
    at = std::min(at, std::max(free, babbler.since));
  }
  return at;
}

bool BusTraffic::Advance(Heard* heard) {
  if (stuck_.at != kNever) {
    StickOn(stuck_.step_at);
    return false;
  }
  if (!on_wire_.sending) {
    if (nodes_.any_off() && nodes_.NextRecovery(idle_at_) <= NextBegin()) {
      RecoverThrough(nodes_.NextRecovery(idle_at_));
      return false;
    }
    BeginFrame(NextBegin());
    if (options_.bit_clock || !on_wire_.sending) return false;
  }
  on_wire_.sending = false;
  return EndFrame(heard);
}

// ---- the begin of a frame

std::optional<QueuedFrame> BusTraffic::Arbitrate(HostInstant now) {
  // Suspend transmission: a passive node that sent last leaves the next eight bits to the others.
  std::optional<QueuedFrame> best =
      queue_.Take(now, now < suspended_.until ? suspended_.node : kNobody);
  on_wire_.babbling = false;
  for (const Babbler& babbler : babblers_) {
    const bool suspended = babbler.node == suspended_.node && now < suspended_.until;
    if (!Hears(babbler.node) || suspended || now < babbler.since) continue;
    if (best && best->waiting.frame.id <= babbler.frame.id) continue;
    if (best && !on_wire_.babbling) queue_.Return(*best);
    best =
        QueuedFrame{.ready = now, .waiting = {babbler.frame, babbler.node != kHost, babbler.node}};
    on_wire_.babbling = true;
  }
  return best;
}

void BusTraffic::BeginFrame(HostInstant now) {
  const std::optional<QueuedFrame> best = Arbitrate(now);
  if (!best) {
    FOCALFLEET_CHECK(now < suspended_.until && queue_.any_ready());
    suspended_.held_until = suspended_.until;
    return;
  }
  if (nodes_.any_off()) nodes_.CountRowsWhileIdle(idle_at_, now);
  on_wire_.entry = *best;
  on_wire_.sending = true;
  on_wire_.abandoned = false;
  on_wire_.refusing = kNobody;
  counters_.idle = counters_.idle + (now - idle_at_);
  if (on_wire_.entry.repeated) ++counters_.repeats;
  on_wire_.began_at = idle_at_ = now;
  on_wire_.course = DrawCourse();
  if (options_.bit_clock) idle_at_ = now + options_.Bits(on_wire_.course.bits);
}

/// The first disturbed bit is geometric: P(none in b bits) = (1 - rate)^b.
FrameCourse BusTraffic::DrawCourse() {
  const CanFrame& frame = on_wire_.entry.waiting.frame;
  const std::uint32_t sender = on_wire_.entry.node();
  FrameCourse course;
  if (options_.bit_clock) course = nodes_.hearing() > 1 ? WellSent(frame) : Unacknowledged(frame);
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
    if (nodes_.hearing() > 2) on_wire_.refusing = nodes_.DrawReceiver(sender, &chance_);
  }
  return course;
}

// ---- the end of a frame

bool BusTraffic::EndFrame(Heard* heard) {
  counters_.Charge(idle_at_ - on_wire_.began_at, on_wire_.course.error != FrameError::kNone);
  const std::uint32_t sender = on_wire_.entry.node();
  if (nodes_.any_off()) nodes_.CountRowOfFrame(idle_at_);
  if (on_wire_.course.error == FrameError::kNone) {
    counters_.bits += on_wire_.course.bits;
    if (!nodes_.clean()) CountWell(sender);
  } else {
    counters_.error_bits += on_wire_.course.bits;
    ++counters_.errors[static_cast<std::size_t>(on_wire_.course.error)];
    CountError(sender);
    if (on_wire_.course.accepted) ++counters_.received_twice;
    if (!on_wire_.babbling && !on_wire_.abandoned) {
      on_wire_.entry.repeated = true;
      if (Hears(sender)) {
        queue_.Return(on_wire_.entry);
      } else if (sender != kHost) {
        nodes_[sender].kept.push_back(on_wire_.entry);
      } else {
        ++counters_.dropped;
      }
    }
  }
  if (!nodes_.clean() && nodes_[sender].errors.state() == Confinement::kPassive) {
    suspended_.node = sender;
    suspended_.until = idle_at_ + options_.Bits(kSuspendBits);
  }
  if (nodes_.any_off()) RecoverThrough(idle_at_);
  if (!on_wire_.course.accepted) return false;
  heard->sent = on_wire_.entry.waiting;
  heard->at = idle_at_;
  heard->but_not = on_wire_.refusing;
  ++(heard->sent.from_unit ? counters_.unit_frames : counters_.host_frames);
  if (on_wire_.babbling) ++counters_.babbled;
  heard->lost = faults_.drop > 0 && chance_.Uniform() < faults_.drop;
  if (heard->lost) ++counters_.dropped;
  return true;
}

// ---- errors (the rules' numbers: error_counters.h)

void BusTraffic::CountWell(std::uint32_t sender) {
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node) || nodes_[node].errors.clean()) continue;
    Count(node, idle_at_, [&](ErrorCounters* errors) {
      node == sender ? errors->Transmitted() : errors->Received();
    });
  }
}

void BusTraffic::CountError(std::uint32_t sender) {
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node)) continue;
    if (node == sender && !on_wire_.course.lost_arbitration) {
      const bool passive = nodes_[node].errors.state() == Confinement::kPassive;
      if (on_wire_.abandoned || on_wire_.course.excused || (on_wire_.course.unanswered && passive))
        continue;
      Count(node, idle_at_, [](ErrorCounters* errors) { errors->TransmitError(); });
    } else if (node == on_wire_.refusing) {
      // The flag of this node begins one bit before the others' flags and ends one bit before them.
      Count(node, idle_at_, [](ErrorCounters* errors) {
        errors->ReceiveError();
        errors->DominantBehindFlag();
      });
    } else if (!on_wire_.course.accepted) {
      Count(node, idle_at_, [](ErrorCounters* errors) { errors->ReceiveError(); });
    }
  }
}

// ---- bus-off and recovery

void BusTraffic::GoOff(std::uint32_t node, HostInstant now) {
  const bool waits = node == kHost && options_.host_restart == DurationNs{kNever.ns};
  nodes_.GoOff(node, waits ? kNever : node == kHost ? now + options_.host_restart : now);
  ++counters_.went_off;
  std::vector<QueuedFrame>& kept = nodes_[node].kept;
  queue_.TakeAllOf(node, &kept);
  if (node != kHost) return;
  counters_.dropped += kept.size();  // a driver drops the frames that it holds as well
  kept.clear();
}

void BusTraffic::RecoverThrough(HostInstant now) {
  for (const std::uint32_t node : nodes_.TakeRecovered(idle_at_, now)) {
    Count(node, now, [](ErrorCounters* errors) { errors->Recover(); });
    ++counters_.recovered;
    Rejoin(node, now);
  }
}

void BusTraffic::Rejoin(std::uint32_t number, HostInstant now) {
  BusNode& node = nodes_[number];
  if (!Hears(number)) return;
  nodes_.CountAsHearing();
  for (Babbler& babbler : babblers_)
    if (babbler.node == number) babbler.since = std::max(babbler.since, now);
  for (QueuedFrame& entry : node.kept) {
    entry.ready = std::max(entry.ready, now);
    Admit(entry);
  }
  node.kept.clear();
}

// ---- a stuck wire

/// A dominant wire, as the nodes see it. The sixth equal bit is an error (rules 1 and 3), and their
/// flag takes six bits. The bit behind it is dominant (rule 2). Each further eight dominant bits
/// count again (rule 6), until no node can lose any more.
void BusTraffic::StickOn(HostInstant now) {
  bool all_passive = true;
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    if (!Hears(node)) continue;
    const bool sends = node == stuck_.sender;
    Count(node, now, [&](ErrorCounters* errors) {
      if (!sends) {
        stuck_.steps == 0 ? errors->ReceiveError() : errors->DominantBehindFlag();
      } else if (stuck_.steps != 1) {
        errors->TransmitError();
      }
    });
    all_passive = all_passive && !sends && state(node) != Confinement::kActive;
  }
  stuck_.step_at = all_passive ? kNever : now + options_.Bits(stuck_.steps < 2 ? kFlagBits + 1 : 8);
  ++stuck_.steps;
}

}  // namespace focalfleet::sim
