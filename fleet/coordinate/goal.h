// A goal is the task of one configuration as values: a command that has been checked. A command
// that cannot be taken is refused here, whole, with the reason.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/coordination.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct Goal {
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::string source;
  bool fixed = false;
  bool unproven = false;  // HomeCommand::unproven
  std::optional<ApplyCommand::Measure> measure = {};
  std::vector<std::optional<Pose>> targets = {};  // Shape: (n)
  std::vector<std::string> target_ids = {};       // Shape: (n), or empty
  std::vector<std::optional<Pose>> offsets = {};  // Shape: (n), or empty
  std::vector<PositionerIndex> to_home = {};      // ascending, each once
};

/// Errors: kRefused while the store cannot be written or nothing can measure; kInvalid where the
/// command is for another layout, or names no unit.
Result<Goal> GoalOf(const Coordination& fleet, const ApplyCommand& command);
/// Errors: as above; kRefused where one of the units cannot be moved. In a sector of a plane these
/// are among the units to home, as no unit is no error.
Result<Goal> GoalOf(const Coordination& fleet, const HomeCommand& command);
/// Errors: as above. The targets of the configuration before stay.
Result<Goal> GoalOf(const Coordination& fleet, const MeasureCommand& command);

}  // namespace focalfleet
