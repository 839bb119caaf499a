#include "fleet/plane/plane_tasks.h"

#include <algorithm>
#include <string>
#include <utility>

namespace focalfleet {
namespace {

/// Errors: kRefused: the unit's sector cannot take part now.
Status CheckSectorOf(PositionerIndex i, const PlaneLayout& plane, const SectorBook& sectors) {
  const std::uint32_t sector = plane.SectorOf(i);
  if (sectors.IsUsable(sector)) return {};
  return Fail(ErrorCode::kRefused, "unit " + std::to_string(plane.layout().unit(i).id.value) +
                                       " is of " + NameOfSector(sector) + ", which " +
                                       sectors[sector].trouble);
}

}  // namespace

Result<PlaneConfiguration> TaskOf(const PlaneApplyCommand& command, const PlaneLayout& plane) {
  const std::size_t units = plane.layout().size();
  if (command.targets.size() != units ||
      (!command.target_ids.empty() && command.target_ids.size() != units))
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  return PlaneConfiguration{.source = command.source,
                            .fixed = command.fixed,
                            .targets = command.targets,
                            .target_ids = command.target_ids,
                            .measure = command.measure};
}

Result<PlaneConfiguration> TaskOf(const PlaneHomeCommand& command, const PlaneLayout& plane,
                                  const SectorBook& sectors) {
  if (command.units.empty()) return Fail(ErrorCode::kInvalid, "no unit to home");
  PlaneConfiguration task{.source = "home",
                          .targets = {},
                          .target_ids = {},
                          .kind = ConfigurationKind::kHome,
                          .to_home = command.units,
                          .unproven = command.unproven};
  task.targets.resize(plane.layout().size());
  std::ranges::sort(task.to_home);
  const auto twice = std::ranges::unique(task.to_home);
  task.to_home.erase(twice.begin(), twice.end());
  if (task.to_home.back().value >= plane.layout().size())
    return Fail(ErrorCode::kInvalid, "a unit to home that is none of this plane");
  for (const PositionerIndex i : task.to_home) FOCALFLEET_TRY(CheckSectorOf(i, plane, sectors));
  return task;
}

PlaneConfiguration MeasurementAfter(const std::optional<PlaneConfiguration>& last,
                                    const PlaneLayout& plane) {
  PlaneConfiguration task{
      .source = "measure", .targets = {}, .target_ids = {}, .kind = ConfigurationKind::kMeasure};
  task.targets.resize(plane.layout().size());
  if (last && last->kind != ConfigurationKind::kHome) task.targets = last->targets;
  return task;
}

Result<std::uint64_t> Retarget(const PlaneRetargetCommand& command, const PlaneLayout& plane,
                               const SectorBook& sectors, PlaneConfiguration* configuration) {
  if (configuration->kind != ConfigurationKind::kApply)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(configuration->id) + " (" +
                                         configuration->source + ") has no targets");
  if (command.unit.value >= plane.layout().size())
    return Fail(ErrorCode::kInvalid, "another target for a unit that is none of this plane");
  FOCALFLEET_TRY(CheckSectorOf(command.unit, plane, sectors));
  auto& changes = configuration->changes;
  const std::uint64_t change = changes.empty() ? 1 : changes.rbegin()->first + 1;
  std::erase_if(changes, [&](const auto& earlier) { return earlier.second == command.unit; });
  changes.emplace(change, command.unit);
  configuration->targets[command.unit.value] = command.target;
  if (!configuration->target_ids.empty()) configuration->target_ids[command.unit.value].clear();
  return change;
}

std::shared_ptr<const SectorTask> PartOf(const PlaneConfiguration& configuration,
                                         const PlaneLayout& plane, std::uint32_t sector) {
  auto task = std::make_shared<SectorTask>();
  if (configuration.kind == ConfigurationKind::kHome) {
    HomeCommand home{.units = {}, .unproven = configuration.unproven};
    for (const PositionerIndex i : configuration.to_home)
      if (plane.SectorOf(i) == sector) home.units.push_back(plane.Local(i));
    task->what = std::move(home);
    return task;
  }
  if (configuration.kind == ConfigurationKind::kMeasure) {
    task->what = MeasureCommand{};
    return task;
  }
  ApplyCommand apply{.source = configuration.source, .targets = {}, .fixed = configuration.fixed};
  apply.measure = configuration.measure;
  for (const PositionerIndex i : plane.own(sector)) {
    apply.targets.push_back(configuration.targets[i.value]);
    if (!configuration.target_ids.empty())
      apply.target_ids.push_back(configuration.target_ids[i.value]);
  }
  task->what = std::move(apply);
  return task;
}

std::uint64_t LastChangeOf(const PlaneConfiguration& configuration, const PlaneLayout& plane,
                           std::uint32_t sector) {
  std::uint64_t last = 0;
  for (const auto& [number, unit] : configuration.changes)
    if (plane.SectorOf(unit) == sector) last = number;
  return last;
}

PlaneOrder RetargetsOf(const PlaneConfiguration& configuration, const PlaneLayout& plane,
                       const PlaneConfigurationId& id, std::uint32_t sector) {
  PlaneOrder order{.kind = OrderKind::kRetarget, .configuration = id};
  for (const auto& [number, unit] : configuration.changes) {
    if (plane.SectorOf(unit) != sector) continue;
    order.retargets.push_back({number, {plane.Local(unit), *configuration.targets[unit.value]}});
    order.change = number;
  }
  return order;
}

}  // namespace focalfleet
