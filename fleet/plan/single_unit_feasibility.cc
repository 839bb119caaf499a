#include "fleet/plan/single_unit_feasibility.h"

#include <algorithm>

#include "fleet/plan/no_way.h"

namespace focalfleet {
namespace {

// A proof that the things that never move leave the unit no way to its goal. Covers of units of
// uncertain place are wider than these units may be, so a unit next to one has no such proof.
std::optional<NoWay> NoWayFor(const Service& service, std::uint32_t unit) {
  const Scene& scene = service.scene();
  std::vector<Blocker> never_move;
  for (const NeighbourNeed& near : scene.neighbours(unit)) {
    const std::uint32_t j = near.unit;
    if (!scene.is_place(j)) continue;
    if (scene.layout().unit({j}).enabled && service.request().frozen[j] == 0) continue;
    const double least_mm = std::min(scene.FullNeed(unit, j) - kClearToleranceMm, near.need_mm);
    never_move.push_back({{scene.arm(j).At(service.start(j)), 0}, least_mm, j});
  }
  for (const StandingThing& thing : scene.standing(unit)) {
    if (thing.by != kNoUnitIndex) continue;
    never_move.push_back({thing.capsule, thing.least_mm, thing.by});
  }
  if (never_move.empty()) return std::nullopt;
  return ProveNoWay({.arm = &scene.arm(unit),
                     .never_move = never_move,
                     .from = service.start(unit),
                     .to = service.goal(unit)});
}

}  // namespace

bool CanEver(const Service& service, std::uint32_t unit, Surroundings* surroundings,
             std::optional<NoWay>* proof) {
  const Scene& scene = service.scene();
  proof->reset();
  if (service.goal(unit) == service.start(unit)) return true;
  std::vector<std::uint8_t> immovable(scene.size());
  for (const NeighbourNeed& near : scene.neighbours(unit))
    immovable[near.unit] = !service.is_movable(near.unit) && !service.is_given(near.unit) ? 1 : 0;
  PathSearch::Question question;
  question.arm = &scene.arm(unit);
  question.drive = &service.request().drives[unit];
  question.blockers = surroundings->AroundOf(unit, immovable);
  question.from = service.start(unit);
  question.within = RangeAround(*question.arm, question.from);
  question.goal = PoseBox::Of(service.goal(unit));
  for (const double grid_deg : kSearchGridsDeg) {
    question.grid_deg = grid_deg;
    if (!surroundings->search().Find(question).empty()) return true;
  }
  *proof = NoWayFor(service, unit);
  return false;
}

std::uint32_t InTheWayOf(const Service& service, std::uint32_t unit) {
  const Scene& scene = service.scene();
  const ArmGeometry& arm = scene.arm(unit);
  const PhiSpan& cell = scene.cell(unit);
  if (!scene.HasCell(unit)) return kNoUnitIndex;
  for (const std::span<const Pose> poses : {service.starts(), service.goals()}) {
    Pose end = poses[unit];
    end[1] = std::clamp(end[1], cell.low, cell.high);
    const Sweep sweep{poses[unit], end};
    for (const NeighbourNeed& near : scene.neighbours(unit)) {
      if (!scene.is_place(near.unit)) continue;
      const Capsule there{scene.arm(near.unit).At(poses[near.unit]), 0};
      if (!SweepClearOf(arm, sweep, there, near.need_mm)) return near.unit;
    }
    for (const StandingThing& thing : scene.standing(unit))
      if (!SweepClearOf(arm, sweep, thing.capsule, thing.need_mm)) return thing.by;
  }
  return kNoUnitIndex;
}

}  // namespace focalfleet
