// The coordination is what every room of the coordinator works with: the units, the questions to
// them, the ledger of rows, and the present step. A room keeps a copy of these references, and owns
// nothing else but its own data.
#pragma once

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/ledger.h"
#include "fleet/coordinate/requests.h"
#include "fleet/coordinate/step_state.h"
#include "fleet/coordinate/unit_table.h"
#include "fleet/coordinate/unit_timers.h"

namespace focalfleet {

/// References to parts that the coordinator owns.
struct Coordination {
  const Layout& layout;
  const CoordinatorConfig& config;
  const StepState& step;
  UnitTable& units;
  UnitTimers& timers;
  Requests& requests;
  Ledger& ledger;

  [[nodiscard]] HostInstant now() const { return step.now; }
  [[nodiscard]] Effects& out() const { return *step.out; }
  [[nodiscard]] const UnitDrive& drive(PositionerIndex i) const { return units.drives[i.value]; }
};

}  // namespace focalfleet
