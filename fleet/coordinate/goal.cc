#include "fleet/coordinate/goal.h"

#include <algorithm>

namespace focalfleet {
namespace {

bool CanMeasure(const Coordination& fleet) {
  return fleet.config.has_camera ||
         (fleet.config.reads_sensors &&
          std::ranges::any_of(fleet.layout.units(),
                              [](const Unit& unit) { return unit.sensors > 0; }));
}

}  // namespace

Result<Goal> GoalOf(const Coordination& fleet, const ApplyCommand& command) {
  const std::size_t units = fleet.units.size();
  if (fleet.ledger.store_failing())
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.targets.size() != units)
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  if (!command.target_ids.empty() && command.target_ids.size() != units)
    return Fail(ErrorCode::kInvalid, "names of targets for another layout");
  if (!command.offsets.empty() && command.offsets.size() != units)
    return Fail(ErrorCode::kInvalid, "offsets for another layout");
  if (command.measure && !CanMeasure(fleet))
    return Fail(ErrorCode::kRefused, "there is no camera to measure with: [camera] directory");
  return Goal{.kind = ConfigurationKind::kApply,
              .source = command.source,
              .fixed = command.fixed,
              .measure = command.measure,
              .targets = command.targets,
              .target_ids = command.target_ids,
              .offsets = command.offsets};
}

Result<Goal> GoalOf(const Coordination& fleet, const HomeCommand& command) {
  if (fleet.ledger.store_failing())
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.units.empty() && !fleet.config.in_plane)
    return Fail(ErrorCode::kInvalid, "no unit to home");
  for (const PositionerIndex i : command.units)
    if (i.value >= fleet.units.size())
      return Fail(ErrorCode::kInvalid, "a unit to home that is none of this layout");
    else if (!fleet.config.in_plane && fleet.units[i].view.phase != UnitPhase::kReady)
      return Fail(ErrorCode::kRefused,
                  fleet.units.NameOf(i) + " cannot home: it " + fleet.units.TroubleOf(i));
  Goal goal{.kind = ConfigurationKind::kHome,
            .source = "home",
            .unproven = command.unproven,
            .to_home = command.units};
  goal.targets.assign(fleet.units.size(), std::nullopt);
  std::sort(goal.to_home.begin(), goal.to_home.end());
  goal.to_home.erase(std::unique(goal.to_home.begin(), goal.to_home.end()), goal.to_home.end());
  return goal;
}

Result<Goal> GoalOf(const Coordination& fleet, const MeasureCommand& /*command*/) {
  if (fleet.ledger.store_failing())
    return Fail(ErrorCode::kRefused,
                "the store cannot be written: what is found could not be kept");
  if (!CanMeasure(fleet))
    return Fail(ErrorCode::kRefused, "there is no camera to measure with: [camera] directory");
  Goal goal{
      .kind = ConfigurationKind::kMeasure, .source = "measure", .measure = ApplyCommand::Measure{}};
  for (const UnitRecord& unit : fleet.units.all()) goal.targets.push_back(unit.view.target);
  return goal;
}

}  // namespace focalfleet
