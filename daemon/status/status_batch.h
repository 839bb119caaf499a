// Status of the fleet on its way to DDS, as plain values. The last value of each unit, of each bus,
// of the fleet and of the configuration replaces the earlier ones.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/dds/status_values.h"

namespace focalfleet {

struct StatusBatch {
  std::uint64_t after_batch = 0;  // not to be published before this batch of rows is durable
  std::vector<UnitStatusValue> units;
  std::vector<UnitOrientationValue> orientations;  // of some of these units
  std::vector<BusStatusValue> buses;
  std::optional<FleetStatusValue> fleet;
  std::optional<ConfigurationProgressValue> configuration;
  std::optional<AuditHeadValue> audit_head;
  double makespan_s = 0;  // of the configuration so far; DDS has that of the rounds that ended
};

}  // namespace focalfleet
