#include "fleet/plane/sector_clock.h"

#include <algorithm>

namespace focalfleet {
namespace {

// Quartz is good for 50 ppm, and each of two clocks may err.
constexpr std::int64_t kDriftPpm = 100;

DurationNs BoundAt(DurationNs bound, DurationNs age) {
  return {bound.ns + age.ns / 1'000'000 * kDriftPpm};
}

}  // namespace

void SectorClock::Add(const Sample& sample) {
  const DurationNs most = sample.received - sample.sent;
  const DurationNs least = sample.returned - sample.now;
  if (most < least) return;
  kept_[count_++ % kKept] = {{{(most.ns + least.ns) / 2}, {(most.ns - least.ns + 1) / 2}},
                             sample.now};
}

std::optional<ClockOffset> SectorClock::At(HostInstant now) const {
  std::optional<ClockOffset> best;
  for (std::size_t n = 0; n < std::min(count_, kKept); ++n) {
    const DurationNs bound = BoundAt(kept_[n].offset.bound, now - kept_[n].at);
    if (!best || bound < best->bound) best = {kept_[n].offset.ahead, bound};
  }
  return best;
}

}  // namespace focalfleet
