// Entries of the history that the store keeps, as StoreReader lists them.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/records.h"

namespace focalfleet {

/// From `since` until just before `until`.
/// The work of a piece of pruning.
struct Pruned {
  std::uint64_t rows = 0;  // that are gone
  bool more = false;       // the round is not over
};

struct Period {
  WallTime since{std::numeric_limits<std::int64_t>::min()};
  WallTime until{std::numeric_limits<std::int64_t>::max()};
};

/// A motion of a unit, from the intent to its end. Units: vectors.
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
  std::optional<UnitKnowledge> ended_at;  // knowledge of the unit at the end
  std::uint64_t entry = 0;                // number in the store
};

struct ConfigurationHistory {
  ConfigurationRow row;
  WallTime began;
  WallTime changed;  // time of the last write; where done, stopped or failed: the end
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

/// A change of a place: bound to a serial number, disabled, enabled.
struct UnitHistory {
  std::uint64_t entry = 0;
  UnitId unit;
  SerialNumber serial;
  bool enabled = true;
  std::string reason;
  WallTime at;
};

/// Numbers of the newest entries of each kind. Numbers only grow, whatever the clock does.
struct EntryNumbers {
  std::uint64_t alarm = 0;
  std::uint64_t unit = 0;
  std::uint64_t begun = 0;  // configuration that began
  std::uint64_t ended = 0;  // configuration that is over
};

/// Entries after some numbers, the oldest first.
struct EntriesAfter {
  std::vector<AlarmHistory> alarms;
  std::vector<UnitHistory> units;
  std::vector<ConfigurationHistory> begun;
  std::vector<ConfigurationHistory> ended;
};

/// Entries of the audit that are asked for, the newest `limit` of them.
struct AuditFilter {
  Period period = {};
  std::string name = {};  // of the caller; empty: all
  std::string verb = {};  // empty: all
  std::uint32_t limit = 1000;
};

/// The distance of a unit from its target in an exposure.
struct MeasuredError {
  UnitId unit;
  double error_um = 0;
};

/// A page of what the store has of one configuration.
struct ReplayPage {
  std::optional<ConfigurationHistory> configuration;  // none: there is none of that number
  std::vector<MoveHistory> moves;                     // the oldest first
  bool more = false;                                  // moves follow the last of these
  // The last exposure of the configuration, with the first page only.
  std::uint64_t exposure = 0;  // 0: it was never measured
  std::vector<MeasuredError> errors = {};
};

struct MeasurementHistory {
  MeasurementRow row;
  WallTime at;  // when it was stored
  /// The unit was moved again after this exposure, in the same configuration: it is elsewhere now.
  bool moved_since = false;
};

/// A unit in an exposure.
struct UnitMeasured {
  std::uint64_t configuration = 0;
  std::uint64_t exposure = 0;
  MeasurementStatus status = MeasurementStatus::kMeasured;
  std::optional<double> error_um;  // from its target
  WallTime at;                     // when it was stored
};

struct ModelHistory {
  ModelRow row;  // without its text
  WallTime at;
};

}  // namespace focalfleet
