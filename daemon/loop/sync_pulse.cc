#include "daemon/loop/sync_pulse.h"

namespace focalfleet {

std::string SyncPulse::Serve(HostInstant now) {
  std::string trouble;
  const auto set = [&](bool active) {
    const Status done = line_->Set(active);
    if (!done) trouble = done.error().text;
    return done.has_value();
  };
  if (now >= down_at_) {
    down_at_ = kNever;
    set(false);
  }
  if (now < at_) return trouble;
  const DurationNs late = now - at_;
  at_ = kNever;
  if (late > options_.late_most) {
    ++missed_;
    return name() + ": the pulse was due " + std::to_string(late.ns / 1000) +
           " us ago and is left out: units begin by their own clocks";
  }
  if (set(true)) {
    ++pulses_;
    down_at_ = now + options_.width;
  } else {
    ++missed_;
  }
  return trouble;
}

}  // namespace focalfleet
