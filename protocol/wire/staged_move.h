// A move as the wire carries it and as the unit holds it. Both ends compute its digest from the
// same bytes, so an equal digest means that the unit holds exactly the planned move.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

/// Up to limits::kSegmentsPerAxis segments, without heap.
class AxisPath {
 public:
  [[nodiscard]] std::span<const Segment> segments() const { return {segments_.data(), size_}; }
  [[nodiscard]] std::uint8_t size() const { return size_; }
  [[nodiscard]] bool full() const { return size_ == limits::kSegmentsPerAxis; }
  void Append(const Segment& segment) {
    FOCALFLEET_CHECK(!full());
    segments_[size_++] = segment;
  }

 private:
  std::array<Segment, limits::kSegmentsPerAxis> segments_{};
  std::uint8_t size_ = 0;
};

struct StagedMove {
  MoveId move;
  WaveMode mode = WaveMode::kAsymmetric;
  std::array<AxisPath, kAxisCount> path;
};

/// The digest is CRC-32 (IEEE 802.3, reflected) of the payload bytes of StageBegin and of every
/// StageSegment, in the order theta 0.., phi 0...
std::uint32_t Digest(const StagedMove& move);

}  // namespace focalfleet
