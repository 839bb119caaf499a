// A unit event is a change of a unit that the configuration under way must take into account.
// Sessions report events; the executor takes them at the end of the step. Neither calls the other
// back.
#pragma once

#include <cstdint>
#include <string>

#include "protocol/base/ids.h"

namespace focalfleet {

enum class UnitEventKind : std::uint8_t {
  kReady,          // read anew, or its motion ended where it should: its knowledge is settled
  kStopped,        // its motion ended before its end
  kNeverBegan,     // did not start with the others
  kUnheard,        // in motion, does not answer at once, or has not begun yet: may have ended
  kEnded,          // in motion, reports that it stands, not yet where
  kLost,           // silent, restarted, foreign or faulty: cannot be used
  kForeignStop,    // it obeyed a stop of another host
  kStartReported,  // its start is known
};
struct UnitEvent {
  PositionerIndex unit;
  UnitEventKind kind;
  std::string reason;
};

}  // namespace focalfleet
