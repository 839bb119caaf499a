// The questions to the searches of a dense plate, about units as all others move now: where each
// neighbour is (occupancy.h), which of them are near, and when power has room.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/plan/joint_search.h"
#include "fleet/plan/motions.h"
#include "fleet/plan/occupancy.h"
#include "fleet/plan/pose_grid.h"

namespace focalfleet {

class StepQuestions {
 public:
  /// Lifetime: `motions` outlives this.
  explicit StepQuestions(const Motions* motions);

  [[nodiscard]] const TimeSteps& steps() const { return occupancy_.steps(); }
  /// The unit has another motion, or none.
  void Forget(std::uint32_t unit) { occupancy_.Forget(unit); }
  /// Finds the steps in which power has no room for all these units.
  void FindRests(std::span<const std::uint32_t> units, std::int32_t end_step);
  [[nodiscard]] std::span<const std::uint8_t> rests() const { return rests_; }
  /// The question about the m-th of some units that are planned anew together. Lifetime: until the
  /// m-th is asked about again, and rests are found again.
  StepQuestion Ask(std::uint32_t unit, std::size_t m, std::int32_t end_step);
  /// The distance that two neighbours keep. Units: mm.
  [[nodiscard]] double NeedOf(std::uint32_t a, std::uint32_t b) const {
    return scene_.neighbours(a)[motions_.SlotOf(a, b)].need_mm;
  }

 private:
  const Motions& motions_;
  const LocalSearchRequest& q_;
  const Scene& scene_;
  Occupancy occupancy_;
  std::array<Surround, JointSearch::kMembersMax> around_;
  std::array<std::vector<MovingNeighbour>, JointSearch::kMembersMax> moving_;
  std::vector<std::uint8_t> rests_;
};

}  // namespace focalfleet
