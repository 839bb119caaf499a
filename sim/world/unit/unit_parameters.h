// The parameters that a unit keeps in FLASH, as requests read and write them, each within its
// bounds.
#pragma once

#include <cstdint>

#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"
#include "sim/world/unit/board.h"
#include "sim/world/unit/flash.h"

namespace focalfleet::sim {

/// The position that is applied at `now`, within what the wire carries. Units: vectors.
std::int32_t AppliedPosition(const Board& board, Axis axis, BoardInstant now);

std::int32_t ReadParameter(const Board& board, const Flash& flash, const ParameterRead& m,
                           BoardInstant now);

/// kOk: `flash` has the value, and the board shows it; it is not kept yet. Otherwise nothing has
/// changed. Pre: the unit is at rest.
Answer WriteParameter(const Board& board, Flash* flash, const ParameterWrite& m);

}  // namespace focalfleet::sim
