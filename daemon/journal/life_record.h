// A record of what the coordinator begins a life from: the layout, the drives, its configuration
// and the fleet as it was read from the store. A journal of the steps is of no use without it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/coordinator.h"
#include "fleet/layout.h"

namespace focalfleet::journal {

struct LifeRecord {
  std::string version;  // of the program that wrote it
  WallTime at;          // the life began then
  std::vector<Unit> units;
  double clearance_mm = 0;
  std::vector<Obstacle> obstacles;
  std::vector<UnitDrive> drives;  // Shape: (n), in the order of `units`
  CoordinatorConfig config;
  StoredFleet stored;
};

/// The record of a coordinator that is about to begin.
LifeRecord LifeOf(const Layout& layout, std::vector<UnitDrive> drives,
                  const CoordinatorConfig& config, StoredFleet stored);

std::string BytesOf(const LifeRecord& life);
/// Errors: kInvalid: the bytes are no such record.
Result<LifeRecord> LifeFrom(std::string_view bytes);

}  // namespace focalfleet::journal
