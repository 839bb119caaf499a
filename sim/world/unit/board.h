// The board on which a unit's protocol runs: two motors, a clock and a FLASH. The interface is a
// table of plain functions, so that C can fill it in. `context` is the board's own and handed back.
//
// The simulator fills the table with axes that turn and a clock that runs fast or slow. Firmware
// fills it with a timer interrupt, the bridge's PWM and a page of FLASH.
#pragma once

#include <cstddef>
#include <cstdint>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

/// Nanoseconds of the clock in which the board counts. The protocol only compares them and asks
/// `after` for later ones, so it need not know how the board's clock runs.
using BoardInstant = HostInstant;

/// A vector to be applied, whole turns included: `position` vectors from the axis' zero.
struct Field {
  std::int32_t position = 0;
  std::uint16_t subdivision = 96;
};

/// A path to be run from the vector that is applied now. Each segment begins at its start_ticks
/// after `begin`, or when the one before has ended. The segment shows its |delta| vectors one by
/// one, each for repeat * counter1 timer counts.
struct PathOrder {
  std::int32_t from = 0;  // vectors
  BoardInstant begin;
  std::uint16_t counter1 = 500;
  const Segment* segments = nullptr;  // only during the call
  std::size_t count = 0;
};

struct Board {
  void* context = nullptr;

  // ---- motors; none of them waits

  /// Applies a vector at rest.
  void (*energise)(void* context, Axis axis, Field field) = nullptr;
  /// Begins a path. Returns when its last vector will have been shown for its time.
  BoardInstant (*run)(void* context, Axis axis, PathOrder order) = nullptr;
  /// The field stays at the vector that is applied at `now`; nothing where none runs.
  void (*halt)(void* context, Axis axis, BoardInstant now) = nullptr;
  /// The position that is applied, counted on through the path.
  std::int32_t (*applied)(void* context, Axis axis, BoardInstant now) = nullptr;
  /// Counts on from another number for the same vector.
  void (*recount)(void* context, Axis axis, std::int32_t position) = nullptr;

  // ---- clock

  /// The instant at which `duration` of the unit's own time has passed since `from`.
  BoardInstant (*after)(void* context, BoardInstant from, DurationNs duration) = nullptr;
  /// The counts of the unit's own clock since power-on, low 32 bits. Units: 100 us.
  std::uint32_t (*ticks)(void* context, BoardInstant now) = nullptr;

  // ---- sensors; a board without any leaves both as they are, and speaks protocol version 1

  std::uint8_t sensors = 0;  // at most limits::kSensorsPerUnit
  /// Reads all sensors at `now`, averaged over the time that the board takes for it. `counts` has a
  /// place for each, to be filled with 0..kFullCount, or kNoCount.
  void (*sense)(void* context, BoardInstant now, std::uint16_t* counts) = nullptr;

  // ---- FLASH

  /// The content of Flash outlives a power cut from the return of this call on.
  void (*keep)(void* context) = nullptr;
};

}  // namespace focalfleet::sim
