#include "sim/world/bus/bus_wire.h"

#include <algorithm>

namespace focalfleet::sim {

// ---- frames

void BusWire::Begin(const FrameOnWire& frame, HostInstant now) {
  use_.idle = use_.idle + (now - idle_at_);
  frame_ = frame;
  began_at_ = now;
  idle_at_ = now + options_.Bits(frame.course.bits);
}

FrameOnWire BusWire::End() {
  const FrameOnWire frame = *frame_;
  frame_.reset();
  const bool good = frame.course.error == FrameError::kNone;
  use_.Charge(idle_at_ - began_at_, !good);
  (good ? use_.bits : use_.error_bits) += frame.course.bits;
  if (!good) ++use_.errors[static_cast<std::size_t>(frame.course.error)];
  return frame;
}

std::uint32_t BusWire::BitsOver(HostInstant now) const {
  return static_cast<std::uint32_t>((now - began_at_).ns * options_.bit_rate_bps / 1'000'000'000);
}

std::optional<QueuedFrame> BusWire::CutOff(std::uint32_t node, HostInstant now) {
  if (!frame_ || frame_->entry.node() != node || frame_->abandoned) return std::nullopt;
  frame_->abandoned = true;
  const std::uint32_t at = BitsOver(now);
  const CanFrame& sent = frame_->entry.waiting.frame;
  if (frame_->course.error == FrameError::kNone && at < ExposedBits(sent)) {
    frame_->course = CutOffAt(sent, at);
    frame_->refusing = kNoNode;
    idle_at_ = began_at_ + options_.Bits(frame_->course.bits);
  }
  if (frame_->course.accepted) return std::nullopt;
  return frame_->entry;
}

// ---- a stuck wire

std::optional<QueuedFrame> BusWire::Stick(HostInstant now) {
  std::optional<QueuedFrame> repeated;
  stuck_ = {.since = now};
  if (frame_) {
    // From here on the sender sees other levels than it drives; its frame is repeated later.
    if (!frame_->abandoned) stuck_->sender = frame_->entry.node();
    ++use_.errors[static_cast<std::size_t>(FrameError::kBit)];
    use_.error_bits += BitsOver(now);
    use_.Charge(now - began_at_, true);
    if (frame_->is_repeated()) repeated = frame_->entry;
    frame_.reset();
  } else {
    use_.idle = use_.idle + std::max(now - idle_at_, DurationNs{0});
    stuck_->since = std::max(now, idle_at_);
  }
  idle_at_ = stuck_->since;
  stuck_->step_at = idle_at_ + options_.Bits(kFlagBits);
  return repeated;
}

void BusWire::StickOn(bool last) {
  const DurationNs step = options_.Bits(stuck_->steps < 2 ? kFlagBits + 1 : 8);
  stuck_->step_at = last ? kNever : stuck_->step_at + step;
  ++stuck_->steps;
}

void BusWire::Release(HostInstant now) {
  // All nodes wait for the end of the error frame that they see.
  idle_at_ = std::max(now, stuck_->since) + options_.Bits(kDelimiterBits + kIntermissionBits);
  use_.stuck = use_.stuck + (idle_at_ - stuck_->since);
  use_.busy = use_.busy + (idle_at_ - stuck_->since);
  stuck_.reset();
}

// ---- a dead wire

void BusWire::Kill(HostInstant now) {
  if (frame_) {
    use_.Charge(now - began_at_, true);
  } else {
    use_.idle = use_.idle + std::max(now - idle_at_, DurationNs{0});
  }
  dead_at_ = frame_ ? now : std::max(now, idle_at_);
  frame_.reset();
  dead_ = true;
}

void BusWire::Revive(HostInstant now) {
  dead_ = false;
  idle_at_ = std::max(now, dead_at_);
  use_.dead = use_.dead + (idle_at_ - dead_at_);
}

}  // namespace focalfleet::sim
