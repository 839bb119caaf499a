// The tasks of a plane as values: a configuration with targets, the homing of units, a measurement.
// Commands become tasks here, and each sector's part of a task is made here.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration_view.h"
#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_messages.h"
#include "fleet/plane/sector_book.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct PlaneConfiguration {
  std::uint64_t id = 0;
  std::string source;
  bool fixed = false;
  std::vector<std::optional<Pose>> targets;  // Shape: (units of the plane)
  std::vector<std::string> target_ids;       // Shape: the same, or empty
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::vector<PositionerIndex> to_home = {};  // ascending
  bool unproven = false;                      // HomeCommand::unproven
  std::optional<ApplyCommand::Measure> measure = {};
  /// The last change of each unit whose target was changed since the configuration began, by its
  /// number.
  std::map<std::uint64_t, PositionerIndex> changes = {};
  bool operator==(const PlaneConfiguration&) const = default;
};

/// All that a coordinator keeps.
struct PlaneRecord {
  PlaneEpoch epoch;
  std::uint64_t next_configuration = 1;
  std::optional<PlaneConfiguration> under_way;
  /// The last one that is over, and how it ended: sectors that begin another life hear of it.
  std::optional<PlaneConfiguration> last = {};
  ConfigurationState last_state = ConfigurationState::kDone;
};

struct PlaneApplyCommand {
  std::string source;
  bool fixed = false;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::string> target_ids;
  std::optional<ApplyCommand::Measure> measure = {};
};
struct PlaneStopCommand {};
/// Measures all units once; no unit moves.
struct PlaneMeasureCommand {};
struct PlaneHomeCommand {
  std::vector<PositionerIndex> units;
  bool unproven = false;  // HomeCommand::unproven
};
/// A unit of the configuration under way has another target, and goes there in the next round.
struct PlaneRetargetCommand {
  PositionerIndex unit;
  Pose target{};
};
struct PlaneCommand {
  std::uint64_t request = 0;
  std::variant<PlaneApplyCommand, PlaneStopCommand, PlaneHomeCommand, PlaneRetargetCommand,
               PlaneMeasureCommand>
      what;
};

/// The task of a command. Errors: kInvalid: it is for another plane, or names no unit; kRefused: a
/// unit to home is of a sector that cannot take part.
Result<PlaneConfiguration> TaskOf(const PlaneApplyCommand& command, const PlaneLayout& plane);
Result<PlaneConfiguration> TaskOf(const PlaneHomeCommand& command, const PlaneLayout& plane,
                                  const SectorBook& sectors);
/// Targets of the configuration before stay, so that errors can be reported. `last` may be none.
PlaneConfiguration MeasurementAfter(const std::optional<PlaneConfiguration>& last,
                                    const PlaneLayout& plane);
/// The target is changed; returns the number of the change. Errors: kInvalid: no such unit;
/// kRefused: the task has no targets, or the unit's sector cannot take part.
Result<std::uint64_t> Retarget(const PlaneRetargetCommand& command, const PlaneLayout& plane,
                               const SectorBook& sectors, PlaneConfiguration* configuration);

/// The part of a sector in the task.
std::shared_ptr<const SectorTask> PartOf(const PlaneConfiguration& configuration,
                                         const PlaneLayout& plane, std::uint32_t sector);
/// The number of the last change of a target in the sector; 0: none.
std::uint64_t LastChangeOf(const PlaneConfiguration& configuration, const PlaneLayout& plane,
                           std::uint32_t sector);
/// The order with all changes of targets in the sector.
PlaneOrder RetargetsOf(const PlaneConfiguration& configuration, const PlaneLayout& plane,
                       const PlaneConfigurationId& id, std::uint32_t sector);

}  // namespace focalfleet
