#include "sim/world/axis/field_path.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "protocol/base/check.h"

namespace focalfleet::sim {

DurationNs UnitClock::ToHost(double unit_ns) const {
  return {static_cast<std::int64_t>(std::ceil(unit_ns / rate))};
}
double UnitClock::ToUnitNs(DurationNs host) const { return static_cast<double>(host.ns) * rate; }

double FieldPath::Piece::end_ns() const { return begin_ns + std::abs(delta) * ns_per_vector; }

FieldPath::FieldPath(const Run& run, std::span<const Segment> segments)
    : from_(run.from), to_(run.from), begin_(run.begin), end_(run.begin), clock_(run.clock) {
  FOCALFLEET_CHECK(segments.size() <= pieces_.size());
  double free_ns = 0;
  for (const Segment& segment : segments) {
    Piece& piece = pieces_[count_++];
    piece.begin_ns =
        std::max(free_ns, static_cast<double>(segment.start_ticks) * static_cast<double>(kTick.ns));
    piece.ns_per_vector = segment.repeat * run.counter1 / kTimerCountsPerNs;
    piece.from = to_;
    piece.delta = segment.delta;
    to_ += segment.delta;
    free_ns = piece.end_ns();
  }
  end_ = begin_ + clock_.ToHost(free_ns);
}

std::int32_t FieldPath::Applied(HostInstant at) const {
  const double now_ns = UnitNs(at);
  std::int32_t applied = from_;
  for (const Piece& piece : pieces()) {
    if (now_ns < piece.begin_ns) break;
    const auto shown = static_cast<std::int32_t>(
        std::min(static_cast<double>(std::abs(piece.delta)),
                 std::floor((now_ns - piece.begin_ns) / piece.ns_per_vector) + 1));
    applied = piece.from + (piece.delta < 0 ? -shown : shown);
  }
  return applied;
}

}  // namespace focalfleet::sim
