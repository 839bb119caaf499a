// The move that a unit holds before its start: a stage_begin and the segments that have come.
// Segments may come in any order and any number of times.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/ids.h"
#include "protocol/base/limits.h"
#include "protocol/wire/messages.h"
#include "protocol/wire/staged_move.h"
#include "sim/world/unit/flash.h"

namespace focalfleet::sim {

class Staging {
 public:
  /// Nothing is held: move 0.
  Staging() = default;
  explicit Staging(const StageBegin& begin) : begin_(begin) {}

  [[nodiscard]] MoveId move() const { return begin_.move; }
  [[nodiscard]] bool BeganWith(const StageBegin& begin) const {
    return begin_.move == begin.move && begin_.segments == begin.segments &&
           begin_.mode == begin.mode;
  }
  /// A segment beyond the number that the begin says is ignored.
  void Take(const StageSegment& segment);
  /// All segments have come.
  [[nodiscard]] bool complete() const;
  /// The segments that have come, as a move.
  [[nodiscard]] StagedMove Held() const;
  /// The path from the stored positions stays within both axes' ranges.
  [[nodiscard]] bool PathInRange(const Flash& flash) const;

 private:
  StageBegin begin_;
  std::array<std::array<Segment, limits::kSegmentsPerAxis>, kAxisCount> segments_{};
  std::array<std::uint16_t, kAxisCount> received_{};  // bit per index
};

}  // namespace focalfleet::sim
