// What the store keeps of the past, as entries of the lists that StoreReader gives.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/clock/wall_time.h"
#include "fleet/records.h"

namespace focalfleet {

/// One motion of one unit, from the intent to its end. Units: vectors.
struct MoveHistory {
  std::uint64_t configuration = 0;
  UnitId unit;
  SerialNumber serial;
  MoveId move;
  Pose from{};
  Pose to{};
  UnitKnowledge hull;
  WallTime began;
  std::optional<WallTime> ended;          // none: the intent is open
  std::optional<IntentEnd> end;           // present with `ended`
  std::optional<UnitKnowledge> ended_at;  // what was known of the unit then
};

struct ConfigurationHistory {
  ConfigurationRow row;
  WallTime began;
  WallTime changed;  // last written: the end, where the state is done, stopped or failed
};

struct ParameterHistory {
  ParameterRow row;
  WallTime at;
};

struct TuningHistory {
  TuningRow row;
  WallTime at;
};

struct AlarmHistory {
  AlarmRow row;
  WallTime at;
};

/// What happened to a place: bound to a serial number, disabled, enabled.
struct UnitHistory {
  UnitId unit;
  SerialNumber serial;
  bool enabled = true;
  std::string reason;
  WallTime at;
};

struct MeasurementHistory {
  MeasurementRow row;
  WallTime at;  // stored
  /// The unit was sent again after this exposure, in the same configuration: it is elsewhere now.
  bool moved_since = false;
};

struct ModelHistory {
  ModelRow row;  // without its text
  WallTime at;
};

}  // namespace focalfleet
