// The published state of the fleet, taken from the coordinator as plain values, so that other
// threads may have them.
#pragma once

#include <array>
#include <optional>

#include "daemon/clock/wall_time.h"
#include "daemon/dds/status_values.h"
#include "fleet/coordinator.h"

namespace focalfleet {

class Compensation;

/// The objects of which a snapshot is taken, and its time.
struct FleetView {
  const Layout* layout = nullptr;
  const Coordinator* coordinator = nullptr;
  HostInstant now;
  WallTime at;
  const Compensation* compensation = nullptr;  // none: commands go as they are
};

/// The lesser witness of both axes: a unit is known no better than its worse axis.
Witness WitnessOf(const UnitKnowledge& knowledge);

/// The status of a unit. A moving unit stands where the plan has it at this time.
UnitStatusValue SnapshotUnit(const FleetView& view, PositionerIndex i);
/// The orientation by the unit's sensors; none where they were never read.
std::optional<UnitOrientationValue> SnapshotOrientation(const FleetView& view, PositionerIndex i);
BusStatusValue SnapshotBus(const FleetView& view, BusId bus);

struct FleetCounts {
  std::uint32_t enabled = 0;
  std::array<std::uint32_t, kUnitPhaseCount> by_phase{};
  std::array<std::uint32_t, kWitnessCount> by_witness{};
};
/// The number of units by phase and by witness. Cost: one pass over the units.
FleetCounts CountFleet(const FleetView& view);
/// The makespan of the rounds that ended, and the time of the present one so far. Units: s.
double MakespanSoFar(const FleetView& view);
double HighestBusLoad(const FleetView& view);

}  // namespace focalfleet
