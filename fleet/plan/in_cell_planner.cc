#include "fleet/plan/in_cell_planner.h"

#include <algorithm>
#include <array>

namespace focalfleet {

InCellPlanner::InCellPlanner(const Scene* scene, std::span<const UnitDrive> drives,
                             Surroundings* surroundings, std::span<const Pose> from,
                             std::span<const Pose> to)
    : scene_(scene),
      drives_(drives),
      surroundings_(surroundings),
      poses_(from.begin(), from.end()),
      lines_(from.size()),
      to_(to) {
  for (std::uint32_t i = 0; i < poses_.size(); ++i) {
    lines_[i] = scene_->arm(i).At(poses_[i]);
    if (poses_[i] != to_[i]) pending_.push_back(i);
  }
}

void InCellPlanner::Run() {
  // A unit that leaves its cell meets the others where they are: the units that can turn inside
  // their cells go first.
  for (bool moved = true; moved && !pending_.empty();) moved = Pass(true) || Pass(false);
}

bool InCellPlanner::Pass(bool in_cell) {
  const std::size_t before = pending_.size();
  std::erase_if(pending_, [&](std::uint32_t i) {
    const Way way = WayOf(i, in_cell);
    if (way.empty()) return false;
    for (std::size_t k = 1; k < way.size(); ++k)
      if (way[k].pose != way[k - 1].pose)
        pieces_.push_back({i, {way[k - 1].pose, way[k].pose, way[k].out_of_step}});
    poses_[i] = to_[i];
    lines_[i] = scene_->arm(i).At(to_[i]);
    return true;
  });
  return pending_.size() < before;
}

Way InCellPlanner::WayOf(std::uint32_t unit, bool in_cell) {
  const Pose& from = poses_[unit];
  const Pose& to = to_[unit];
  if (in_cell && !(scene_->InCell(unit, from) && scene_->InCell(unit, to))) return {};
  const ArmGeometry& arm = scene_->arm(unit);
  PathSearch::Question question;
  question.blockers = surroundings_->Around(
      unit, lines_, poses_,
      in_cell ? Surroundings::Include::kOutOfCell : Surroundings::Include::kAll);
  if (SweepClear(arm, {from, to}, question.blockers, nullptr)) return {{from}, {to}};
  question.arm = &arm;
  question.drive = &drives_[unit];
  question.from = from;
  question.within = RangeAround(arm, from);
  if (in_cell) {
    question.within.low[1] = scene_->cell(unit).low;
    question.within.high[1] = scene_->cell(unit).high;
  }
  question.goal = PoseBox::Of(to);
  for (const double grid_deg : kSearchGridsDeg) {
    question.grid_deg = grid_deg;
    Way way = surroundings_->search().Find(question);
    if (!way.empty()) return way;
  }
  return {};
}

}  // namespace focalfleet
