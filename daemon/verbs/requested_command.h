// The command that a request asks of the coordinator. The arguments are read and checked against
// the fleet in its present state, before anything happens.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// The unit of the argument `unit_id`. Errors: kInvalid where there is no such unit.
Result<PositionerIndex> UnitArgument(const Json& args, const Layout& layout);

/// The units by their numbers, each once. Errors: kInvalid names the first that does not exist.
Result<std::vector<PositionerIndex>> UnitsArgument(const Layout& layout,
                                                   const std::vector<std::uint32_t>& ids);
/// The target of one unit: `theta_deg` and `phi_deg`, or `x_mm` and `y_mm`. `places` has where each
/// unit stands or will stand. Errors: kInvalid: no such place, or out of the unit's reach.
Result<Pose> TargetArgument(const Json& args, PositionerIndex i, const Layout& layout,
                            std::span<const UnitDrive> drives,
                            std::span<const UnitKnowledge> places);

/// {corrections?, tolerance_um?, observe?}: without `corrections` nothing is measured. Errors:
/// kInvalid: a number out of its range, or corrections of what is observed alone.
Result<std::optional<ApplyCommand::Measure>> MeasureArgument(const Json& args);

/// A request that changes something, as the coordinator's command. Verbs: apply retarget stop home
/// measure disable enable adopt params_set. Errors: kInvalid or kRefused, with a text for people;
/// nothing has happened then.
Result<Command> CommandOf(const ControlRequest& request, const FleetView& view);

}  // namespace focalfleet
