#include "sim/bus/bus.h"

#include <algorithm>

#include "protocol/base/check.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet::sim {

bool Bus::Offer(const Waiting& waiting, HostInstant ready) {
  if (dead_) {
    ++counters_.dropped;
    return false;
  }
  if (ready_.size() + later_.size() >= options_.mailboxes_max) {
    ++counters_.refused;
    return false;
  }
  Entry entry{ready, order_++, waiting};
  if (faults_.late > 0 && chance_.Uniform() < faults_.late) entry.ready = ready + faults_.late_by;
  Admit(entry);
  if (faults_.duplicate > 0 && chance_.Uniform() < faults_.duplicate) {
    entry.order = order_++;
    Admit(entry);
  }
  return true;
}

void Bus::Admit(const Entry& entry) {
  later_.push(entry);
  counters_.waiting_max =
      std::max(counters_.waiting_max, static_cast<std::uint32_t>(ready_.size() + later_.size()));
}

HostInstant Bus::NextEvent() const {
  if (sending_) return idle_at_;
  if (!ready_.empty()) return std::max(idle_at_, ready_.top().ready);
  if (!later_.empty()) return std::max(idle_at_, later_.top().ready);
  return kNever;
}

bool Bus::Advance(Heard* heard) {
  if (!sending_) {
    BeginFrame();
    if (options_.bit_clock) return false;
  }
  sending_ = false;
  heard->sent = on_wire_;
  heard->at = idle_at_;
  ++(on_wire_.from_unit ? counters_.unit_frames : counters_.host_frames);
  heard->lost = faults_.drop > 0 && chance_.Uniform() < faults_.drop;
  if (heard->lost) ++counters_.dropped;
  return true;
}

void Bus::BeginFrame() {
  const HostInstant now = NextEvent();
  while (!later_.empty() && later_.top().ready <= now) {
    ready_.push(later_.top());
    later_.pop();
  }
  FOCALFLEET_CHECK(!ready_.empty());
  on_wire_ = ready_.top().waiting;
  ready_.pop();
  sending_ = true;
  idle_at_ = now;
  if (!options_.bit_clock) return;
  const std::uint32_t bits = FrameBits(on_wire_.frame);
  const DurationNs taken = BitTime(bits, options_.bit_rate_bps);
  counters_.bits += bits;
  counters_.busy = counters_.busy + taken;
  idle_at_ = now + taken;
}

void Bus::Kill() {
  counters_.dropped += waiting();
  later_ = {};
  ready_ = {};
  sending_ = false;
  dead_ = true;
}

}  // namespace focalfleet::sim
