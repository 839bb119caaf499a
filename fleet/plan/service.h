// The units that shall move and where, which of them are served, and why the others are not. A
// value: a planner that tries something else keeps a copy and restores it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/plan/planner.h"
#include "fleet/plan/scene.h"

namespace focalfleet {

/// The unit's id, which operators know it by.
std::string UnitName(const Layout& layout, std::uint32_t unit);

class Service {
 public:
  /// Serves every target of a unit that may move. Lifetime: all three outlive this. Shape: `start`
  /// (n); of units without a place meaningless.
  Service(const PlanRequest& request, const Scene& scene, std::span<const Pose> start);

  [[nodiscard]] bool is_movable(std::uint32_t unit) const { return movable_[unit] != 0; }
  [[nodiscard]] bool is_served(std::uint32_t unit) const { return served_[unit] != 0; }
  /// The motion of the unit is planned elsewhere and fixed.
  [[nodiscard]] bool is_given(std::uint32_t unit) const {
    return !request_->given.empty() && request_->given[unit] != 0;
  }
  /// The unit is served and not at its target yet.
  [[nodiscard]] bool goes(std::uint32_t unit) const {
    return is_served(unit) && goal_[unit] != start_[unit];
  }
  [[nodiscard]] const Pose& start(std::uint32_t unit) const { return start_[unit]; }
  [[nodiscard]] const Pose& goal(std::uint32_t unit) const { return goal_[unit]; }
  [[nodiscard]] std::span<const Pose> starts() const { return start_; }  // Shape: (n)
  /// Where each unit ends; a unit that is not served ends where it starts. Shape: (n).
  [[nodiscard]] std::span<const Pose> goals() const { return goal_; }
  [[nodiscard]] std::span<const std::uint8_t> movable() const { return movable_; }  // Shape: (n)
  [[nodiscard]] double given_end_s() const { return given_end_s_; }  // of the last given motion
  [[nodiscard]] const PlanRequest& request() const { return *request_; }
  [[nodiscard]] const Scene& scene() const { return *scene_; }

  /// The unit stays where it starts, and may still be moved aside. `by`: the unit to blame, or
  /// kNoUnitIndex. `proof`: that it has no way, where there is one.
  void Unserve(std::uint32_t unit, UnservedWhy why, std::uint32_t by,
               std::optional<NoWay> proof = std::nullopt);
  /// From now on the unit does not move, not even aside.
  void Hold(std::uint32_t unit) { movable_[unit] = 0; }
  /// Serves its target again. Pre: it has one, and was movable at first.
  void Readmit(std::uint32_t unit);
  /// In order of units.
  [[nodiscard]] std::vector<Unserved> NotServed() const;

  /// Targets out of the range of their units, by name. Empty: none.
  [[nodiscard]] std::string TargetsOutOfRange() const;
  /// Pairs of starts of movable units, or of served targets, that are nearer than the rule allows,
  /// by name. Empty: none.
  [[nodiscard]] std::string StartsTooNear() const;
  [[nodiscard]] std::string TargetsTooNear() const;
  /// After this no two served targets touch: one unit of such a pair is not served.
  void DropTargetsThatMeet();
  /// After this no served target touches what stands: its unit is not served. The unit then stands
  /// too, so others may follow.
  void DropCollidingTargets();

 private:
  void TakeGiven(std::uint32_t unit);
  [[nodiscard]] bool Meet(std::uint32_t a, std::uint32_t b) const;
  [[nodiscard]] bool CollidesWith(std::uint32_t unit, std::uint32_t* by) const;

  const PlanRequest* request_;
  const Scene* scene_;
  std::span<const Pose> start_;
  std::vector<Pose> goal_;
  std::vector<std::uint8_t> movable_;
  std::vector<std::uint8_t> served_;
  std::vector<Unserved> unserved_;
  double given_end_s_ = 0;
};

}  // namespace focalfleet
