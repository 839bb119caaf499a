// The transitions of a unit's state, as one table. Every change of the firmware's state goes
// through this table. A transition that is not in it is a bug in the firmware, not an event.
#pragma once

#include <cstddef>

#include "protocol/wire/messages.h"

namespace focalfleet::sim {

// clang-format off
inline constexpr bool kAllowed[kUnitStateCount][kUnitStateCount] = {
    //             rest   staging armed  moving homing fault  host_lost
    /* rest      */ {false, true,  false, false, true,  true,  true },
    /* staging   */ {true,  true,  true,  false, true,  true,  true },
    /* armed     */ {true,  true,  false, true,  false, true,  true },
    /* moving    */ {true,  false, false, false, false, true,  true },
    /* homing    */ {true,  false, false, false, false, true,  true },
    /* fault     */ {true,  false, false, false, false, true,  false},
    /* host_lost */ {true,  false, false, false, false, true,  false},
};
// clang-format on

constexpr bool Allowed(UnitState from, UnitState to) {
  return kAllowed[static_cast<std::size_t>(from)][static_cast<std::size_t>(to)];
}

}  // namespace focalfleet::sim
