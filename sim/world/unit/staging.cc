#include "sim/world/unit/staging.h"

namespace focalfleet::sim {

void Staging::Take(const StageSegment& segment) {
  const std::size_t axis = Index(segment.axis);
  if (segment.index >= begin_.segments[axis]) return;
  segments_[axis][segment.index] = segment.segment;
  received_[axis] = static_cast<std::uint16_t>(received_[axis] | 1u << segment.index);
}

bool Staging::complete() const {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (received_[axis] != (1u << begin_.segments[axis]) - 1) return false;
  return true;
}

StagedMove Staging::Held() const {
  StagedMove held{begin_.move, begin_.mode, {}};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    for (std::size_t i = 0; i < limits::kSegmentsPerAxis; ++i)
      if ((received_[axis] >> i & 1) != 0) held.path[axis].Append(segments_[axis][i]);
  return held;
}

bool Staging::PathInRange(const Flash& flash) const {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisFlash& stored = flash.axis[axis];
    std::int64_t position = stored.position();
    for (std::size_t i = 0; i < begin_.segments[axis]; ++i) {
      position += segments_[axis][i].delta;
      if (position < stored.min_position || position > stored.max_position) return false;
    }
  }
  return true;
}

}  // namespace focalfleet::sim
