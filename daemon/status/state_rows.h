// The answer to `state`: a row of each unit. The core takes the rows as plain values at one
// instant. Their text takes several times as long, and is made on a thread of its own.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/status/status_snapshot.h"
#include "fleet/kinematics.h"

namespace focalfleet {

struct StateRow {
  UnitStatusValue unit;
  std::array<double, kAxisCount> offset_deg{};  // of the count from the place, by axis
  PointFp target;                               // of the fibre; not a number: there is none
  UnitDrive drive;
};

/// The fleet at one instant, which no thread changes any more. Shape: (units).
using StateRows = std::shared_ptr<const std::vector<StateRow>>;

/// Cost: some 0.2 us a unit.
StateRows TakeStateRows(const FleetView& view);

/// {"rows":[...]} as text: Json values would take ten times as long. docs/cli.md has the members.
/// Cost: some 1 us a unit.
std::string StateText(const std::vector<StateRow>& rows);

}  // namespace focalfleet
