#include <cstddef>

#include "fleet/coordinator.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

const char* Name(UnservedWhy why) {
  static constexpr const char* kNames[] = {"disabled", "unknown_place", "blocked",
                                           "target_collides"};
  return kNames[static_cast<std::size_t>(why)];
}

const char* Name(UnitPhase phase) {
  static constexpr const char* kNames[kUnitPhaseCount] = {
      "absent", "identifying", "foreign", "ready",    "staging", "confirming", "arming",
      "armed",  "moving",      "homing",  "settling", "fault",   "silent"};
  return kNames[static_cast<std::size_t>(phase)];
}

}  // namespace focalfleet
