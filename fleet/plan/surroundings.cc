#include "fleet/plan/surroundings.h"

namespace focalfleet {

std::span<const Blocker> Surroundings::Around(std::uint32_t unit, std::span<const SegmentFp> lines,
                                              std::span<const Pose> poses, Include include) {
  blockers_.clear();
  const bool at_start = poses[unit] == start_[unit];
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    const std::uint32_t j = near.unit;
    if (!scene_->is_place(j)) continue;
    if (include == Include::kOutOfCell && scene_->InCell(j, poses[j])) continue;
    const bool both_at_start = at_start && poses[j] == start_[j];
    blockers_.push_back({{lines[j], 0}, both_at_start ? near.at_start_mm : near.need_mm, j});
  }
  for (const StandingThing& thing : scene_->standing(unit)) {
    if (include == Include::kOutOfCell && thing.in_cell) continue;
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  }
  return blockers_;
}

std::span<const Blocker> Surroundings::AroundOf(std::uint32_t unit,
                                                std::span<const std::uint8_t> these) {
  blockers_.clear();
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    if (!scene_->is_place(near.unit) || these[near.unit] == 0) continue;
    const SegmentFp line = scene_->arm(near.unit).At(start_[near.unit]);
    blockers_.push_back({{line, 0}, near.at_start_mm, near.unit});
  }
  for (const StandingThing& thing : scene_->standing(unit))
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  return blockers_;
}

}  // namespace focalfleet
