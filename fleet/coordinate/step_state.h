// The step state is the present of the coordinator: the time of the step under way, and the effects
// that it appends to. Coordinator::Step sets it first.
#pragma once

#include "fleet/coordinate/effects.h"
#include "protocol/base/instants.h"

namespace focalfleet {

struct StepState {
  HostInstant now;
  Effects* out = nullptr;  // Pre: within a step
};

}  // namespace focalfleet
