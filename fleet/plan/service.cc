#include "fleet/plan/service.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "fleet/estimate.h"

namespace focalfleet {
namespace {

/// The pairs of `poses` that are nearer than the rule allows, by name, where both units count.
/// Shape: both (n).
std::string TooNear(const Scene& scene, std::span<const Pose> poses,
                    std::span<const std::uint8_t> counts, const char* what) {
  std::string text;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    if (counts[i] == 0) continue;
    for (const NeighbourNeed& near : scene.neighbours(i)) {
      if (near.unit < i || counts[near.unit] == 0) continue;
      const double distance =
          DistanceMm(scene.arm(i).At(poses[i]), scene.arm(near.unit).At(poses[near.unit]));
      const double need = scene.FullNeed(i, near.unit);
      if (distance >= need - kClearToleranceMm) continue;
      std::array<char, 160> line{};
      std::snprintf(line.data(), line.size(),
                    "%s%s of units %s and %s are %.4f mm apart, %.4f mm needed",
                    text.empty() ? "" : "; ", what, UnitName(scene.layout(), i).c_str(),
                    UnitName(scene.layout(), near.unit).c_str(), distance, need);
      text += line.data();
    }
  }
  return text;
}

}  // namespace

std::string UnitName(const Layout& layout, std::uint32_t unit) {
  return std::to_string(layout.unit({unit}).id.value);
}

Service::Service(const PlanRequest& request, const Scene& scene, std::span<const Pose> start)
    : request_(&request),
      scene_(&scene),
      start_(start),
      goal_(start.begin(), start.end()),
      movable_(scene.size(), 0),
      served_(scene.size(), 0) {
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    const bool enabled = scene.layout().unit({i}).enabled;
    const bool place = scene.is_place(i);
    if (is_given(i) && place) {
      TakeGiven(i);
      continue;
    }
    movable_[i] = enabled && request.frozen[i] == 0 && place ? 1 : 0;
    if (!request.targets[i]) continue;
    if (movable_[i] != 0) {
      Readmit(i);
    } else if (!enabled) {
      Unserve(i, UnservedWhy::kDisabled, kNoUnitIndex);
    } else if (!place) {
      Unserve(i, UnservedWhy::kUnknownPlace, kNoUnitIndex);
    } else if (*request.targets[i] != start[i]) {
      Unserve(i, UnservedWhy::kBlocked, i);
    }
  }
}

void Service::TakeGiven(std::uint32_t unit) {
  const AxisPaths& motion = request_->motions[unit];
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : motion[k].segments()) {
      goal_[unit][k] += segment.delta;
      given_end_s_ = std::max(given_end_s_, TimeOf(segment, request_->drives[unit].axis[k]).t1_s);
    }
}

void Service::Unserve(std::uint32_t unit, UnservedWhy why, std::uint32_t by,
                      std::optional<NoWay> proof) {
  served_[unit] = 0;
  goal_[unit] = start_[unit];
  Unserved unserved{{unit}, why, std::nullopt, std::move(proof)};
  if (by != kNoUnitIndex) unserved.by = PositionerIndex{by};
  unserved_.push_back(std::move(unserved));
}

void Service::Readmit(std::uint32_t unit) {
  movable_[unit] = served_[unit] = 1;
  goal_[unit] = *request_->targets[unit];
  std::erase_if(unserved_, [unit](const Unserved& u) { return u.unit.value == unit; });
}

std::vector<Unserved> Service::NotServed() const {
  std::vector<Unserved> all = unserved_;
  std::sort(all.begin(), all.end(),
            [](const Unserved& a, const Unserved& b) { return a.unit < b.unit; });
  return all;
}

std::string Service::TargetsOutOfRange() const {
  std::string text;
  for (std::uint32_t i = 0; i < scene_->size(); ++i) {
    if (!is_served(i) || scene_->arm(i).range().Contains(goal_[i])) continue;
    text += (text.empty() ? "the target of unit " : "; the target of unit ") +
            UnitName(scene_->layout(), i) + " is outside its axes' ranges";
  }
  return text;
}

std::string Service::StartsTooNear() const {
  return TooNear(*scene_, start_, movable_, "the starts");
}

std::string Service::TargetsTooNear() const {
  return TooNear(*scene_, goal_, served_, "the targets");
}

bool Service::Meet(std::uint32_t a, std::uint32_t b) const {
  return DistanceMm(scene_->arm(a).At(goal_[a]), scene_->arm(b).At(goal_[b])) <
         scene_->FullNeed(a, b) - kClearToleranceMm;
}

void Service::DropTargetsThatMeet() {
  for (std::uint32_t i = 0; i < scene_->size(); ++i) {
    if (!goes(i)) continue;
    for (const NeighbourNeed& near : scene_->neighbours(i)) {
      if (!is_served(near.unit) || !Meet(i, near.unit)) continue;
      Unserve(i, UnservedWhy::kTargetCollides, near.unit);
      break;
    }
  }
}

bool Service::CollidesWith(std::uint32_t unit, std::uint32_t* by) const {
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    if (!scene_->is_place(near.unit) || is_served(near.unit)) continue;
    *by = near.unit;
    if (Meet(unit, near.unit)) return true;
  }
  const SegmentFp line = scene_->arm(unit).At(goal_[unit]);
  for (const StandingThing& thing : scene_->standing(unit)) {
    if (thing.in_cell && scene_->InCell(unit, goal_[unit])) continue;
    *by = thing.by;
    if (DistanceMm(line, thing.capsule.line) < thing.capsule.radius_mm + thing.least_mm)
      return true;
  }
  return false;
}

void Service::DropCollidingTargets() {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::uint32_t i = 0; i < scene_->size(); ++i) {
      std::uint32_t by = kNoUnitIndex;
      if (!goes(i) || !CollidesWith(i, &by)) continue;
      Unserve(i, UnservedWhy::kTargetCollides, by);
      changed = true;
    }
  }
}

}  // namespace focalfleet
