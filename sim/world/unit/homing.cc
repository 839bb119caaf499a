#include "sim/world/unit/homing.h"

#include <array>

#include "sim/world/unit/places.h"

namespace focalfleet::sim {

// The way is the whole range and two electrical turns more, so that the axis reaches its stop from
// anywhere. The way ends on the vector that the stop shows.
BoardInstant Homing::Drive(const Board& board, const Flash& flash, Axis next, BoardInstant now) {
  axis = next;
  const AxisFlash& stored = flash.axis[Index(axis)];
  const std::int32_t range = stored.max_position - stored.min_position;
  const bool up = stored.max_position - stored.home_position <= range / 2;
  const std::int32_t sign = up ? 1 : -1;
  std::int32_t way = range + range / 20 + 2 * stored.subdivision;
  way += FloorMod(sign * (stored.home_position - stored.position()) - way, stored.subdivision);
  // A segment carries 24 bits of way; two segments carry any range.
  const std::int32_t half = way / 2;
  const std::array<Segment, 2> segments{Segment{0, sign * half, stored.repeat},
                                        Segment{0, sign * (way - half), stored.repeat}};
  return board.run(board.context, axis,
                   {stored.position(), now, stored.counter1, segments.data(), segments.size()});
}

void Homing::EndAxis(const Board& board, Flash* flash, BoardInstant now) const {
  AxisFlash& stored = flash->axis[Index(axis)];
  board.halt(board.context, axis, now);
  board.recount(board.context, axis, stored.home_position);
  stored.set_position(stored.home_position);
  flash->lost_axes = static_cast<std::uint8_t>(flash->lost_axes & ~Bit(axis));
  board.keep(board.context);
}

void Homing::StoreCutShort(const Board& board, Flash* flash, BoardInstant now) const {
  AxisFlash& stored = flash->axis[Index(axis)];
  const bool up =
      stored.max_position - stored.home_position <= (stored.max_position - stored.min_position) / 2;
  const std::int32_t applied = board.applied(board.context, axis, now);
  std::uint8_t lost = lost_before;
  if (axis == Axis::kTheta) lost = static_cast<std::uint8_t>(lost & ~Bit(Axis::kPhi));
  if (up ? applied > stored.home_position : applied < stored.home_position) {
    lost = static_cast<std::uint8_t>(lost | Bit(axis));
    const std::int32_t shown = NearestCongruent(stored.home_position, applied, stored.subdivision);
    board.recount(board.context, axis, shown);
    stored.set_position(shown);
  }
  flash->lost_axes = lost;
}

}  // namespace focalfleet::sim
