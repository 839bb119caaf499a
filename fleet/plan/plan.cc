#include "fleet/plan/plan.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/instants.h"

namespace focalfleet {

std::int32_t PositionAt(std::int32_t from, const AxisPath& path, const AxisDrive& drive,
                        double t_s) {
  std::int32_t position = from;
  for (const Segment& segment : path.segments()) {
    const double begins_s = segment.start_ticks * kTick.seconds();
    if (t_s < begins_s) break;
    const AxisDrive as_sent{drive.counter1, segment.repeat, drive.subdivision};
    const double applied = std::floor((t_s - begins_s) / SecondsPerVector(as_sent)) + 1;
    const std::int32_t length = std::abs(segment.delta);
    const auto vectors = static_cast<std::int32_t>(std::min<double>(applied, length));
    position += segment.delta < 0 ? -vectors : vectors;
  }
  return position;
}

double EndOf(const UnitPlan& plan, const UnitDrive& drive) {
  double end_s = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    if (plan.path[k].size() == 0) continue;
    const Segment& last = plan.path[k].segments().back();
    const AxisDrive as_sent{drive.axis[k].counter1, last.repeat, drive.axis[k].subdivision};
    end_s = std::max(end_s, last.start_ticks * kTick.seconds() +
                                std::abs(last.delta) * SecondsPerVector(as_sent));
  }
  return end_s;
}

Span SpanOf(std::int32_t from, const AxisPath& path) {
  Span span{from, from};
  std::int32_t at = from;
  for (const Segment& segment : path.segments()) {
    at += segment.delta;
    span.low = std::min(span.low, at);
    span.high = std::max(span.high, at);
  }
  return span;
}

}  // namespace focalfleet
