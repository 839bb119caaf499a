#include "sim/world/bus/bus.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "sim/world/bus/error_rules.h"

namespace focalfleet::sim {

Bus::Bus(const BusOptions& options, Rng chance)
    : options_(options),
      chance_(chance),
      wire_(options),
      nodes_(options),
      arbitration_(options.mailboxes_max) {}

bool Bus::Offer(const WaitingFrame& waiting, HostInstant ready) {
  if (wire_.dead()) {
    arbitration_.CountDropped();
    return false;
  }
  if (faults_.late > 0 && arbitration_.TakesPart(nodes_[waiting.node()]) &&
      chance_.Uniform() < faults_.late) {
    ready = ready + faults_.late_by;
    ++faults_.acted.late;
  }
  return arbitration_.Offer(waiting, ready, nodes_);
}

BusCounters Bus::counters() const {
  BusCounters counters = counters_;
  counters.wire = wire_.use();
  counters.mailboxes = arbitration_.counters();
  counters.controllers = nodes_.counters();
  return counters;
}

HostInstant Bus::NextEvent() const {
  if (wire_.dead()) return kNever;
  if (wire_.stuck()) return wire_.stuck()->step_at;
  if (wire_.sending()) return wire_.idle_at();
  return std::min(arbitration_.NextBegin(nodes_, wire_.idle_at()),
                  nodes_.NextRecovery(wire_.idle_at()));
}

bool Bus::Advance(Heard* heard) {
  if (wire_.stuck()) {
    const StuckCount counted = CountStuck(*wire_.stuck(), &nodes_);
    for (const std::uint32_t node : counted.off) arbitration_.Hold(node);
    wire_.StickOn(counted.last);
    return false;
  }
  if (!wire_.sending()) {
    const HostInstant recovery = nodes_.NextRecovery(wire_.idle_at());
    const HostInstant begin = arbitration_.NextBegin(nodes_, wire_.idle_at());
    if (recovery != kNever && recovery <= begin) {
      Recover(recovery);
      return false;
    }
    BeginFrame(begin);
    if (options_.bit_clock || !wire_.sending()) return false;
  }
  return EndFrame(heard);
}

void Bus::Recover(HostInstant now) {
  for (const std::uint32_t node : nodes_.TakeRecovered(wire_.idle_at(), now))
    arbitration_.LetIn(node, now);
}

// ---- the begin of a frame

void Bus::BeginFrame(HostInstant now) {
  const std::optional<Arbitration::Winner> winner = arbitration_.Take(nodes_, now);
  if (!winner) return;
  nodes_.CountRowsWhileIdle(wire_.idle_at(), now);
  if (winner->entry.repeated) ++counters_.repeats;
  wire_.Begin(DrawCourse(*winner), now);
}

/// The first disturbed bit is geometric: P(none in b bits) = (1 - rate)^b.
FrameOnWire Bus::DrawCourse(const Arbitration::Winner& winner) {
  const CanFrame& frame = winner.entry.waiting.frame;
  const std::uint32_t sender = winner.entry.node();
  FrameOnWire drawn{.entry = winner.entry, .babbling = winner.babbling};
  FrameCourse& course = drawn.course;
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
      ++faults_.acted.noise;
    }
  }
  if (faults_.duplicate > 0 && course.error == FrameError::kNone &&
      chance_.Uniform() < faults_.duplicate) {
    course = RefusedByOne(frame);
    ++faults_.acted.duplicate;
    if (!options_.bit_clock) course.bits = 0;
    if (nodes_.hearing() > 2) drawn.refusing = nodes_.DrawReceiver(sender, &chance_);
  }
  return drawn;
}

// ---- the end of a frame

bool Bus::EndFrame(Heard* heard) {
  const HostInstant now = wire_.idle_at();
  const FrameOnWire frame = wire_.End();
  const std::uint32_t sender = frame.entry.node();
  nodes_.CountRowOfFrame(now);
  if (frame.course.error == FrameError::kNone) {
    CountWell(sender, now, &nodes_);
  } else {
    for (const std::uint32_t node : CountError(frame, now, &nodes_)) arbitration_.Hold(node);
    if (frame.course.accepted) ++counters_.received_twice;
    if (frame.is_repeated()) arbitration_.Repeat(frame.entry, nodes_);
  }
  if (nodes_[sender].errors.state() == Confinement::kPassive)
    arbitration_.Suspend(sender, now + options_.Bits(kSuspendBits));
  Recover(now);
  if (!frame.course.accepted) return false;
  heard->sent = frame.entry.waiting;
  heard->at = now;
  heard->but_not = frame.refusing;
  ++(heard->sent.from_unit ? counters_.unit_frames : counters_.host_frames);
  if (frame.babbling) ++counters_.babbled;
  heard->lost = faults_.drop > 0 && chance_.Uniform() < faults_.drop;
  if (heard->lost) {
    arbitration_.CountDropped();
    ++faults_.acted.drop;
  }
  return true;
}

}  // namespace focalfleet::sim
