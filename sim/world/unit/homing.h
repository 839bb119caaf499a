// Homing drives one axis after the other to its hard stop, phi first, and counts the axis from
// there. A homing that is cut short leaves an axis lost unless its place was known before and it
// cannot have met the stop.
#pragma once

#include <cstdint>

#include "protocol/base/ids.h"
#include "sim/world/unit/board.h"
#include "sim/world/unit/flash.h"

namespace focalfleet::sim {

struct Homing {
  Axis axis = Axis::kPhi;        // the one that drives now
  std::uint8_t lost_before = 0;  // Flash::lost_axes when the homing began

  /// `next` drives to its stop. Returns when its last vector will have been shown for its time.
  BoardInstant Drive(const Board& board, const Flash& flash, Axis next, BoardInstant now);
  /// The axis stands at its stop: FLASH has its home position, and it is no longer lost.
  void EndAxis(const Board& board, Flash* flash, BoardInstant now) const;
  /// FLASH says which axes are lost now. Pre: the axis was halted and its position stored.
  void StoreCutShort(const Board& board, Flash* flash, BoardInstant now) const;
};

}  // namespace focalfleet::sim
