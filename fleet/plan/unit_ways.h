// Other ways for one unit of a local search, and the choice among them. A way comes from the fixed
// list of candidates (candidates.h), from a search in time among moving neighbours (time_search.h),
// or from a search among what stands (path_search.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/plan/candidates.h"
#include "fleet/plan/motions.h"
#include "fleet/plan/path_search.h"
#include "fleet/plan/time_search.h"
#include "protocol/base/rng.h"

namespace focalfleet {

class UnitWays {
 public:
  /// Lifetime: both outlive this.
  UnitWays(Motions* motions, Rng* rng)
      : motions_(*motions),
        q_(motions->request()),
        rng_(*rng),
        known_ways_(motions->scene().size()) {}

  /// The question for candidates from the unit's start to its target.
  [[nodiscard]] CandidateQuestion QuestionFor(std::uint32_t unit, double within_s) const;
  /// All candidates of the unit that end within `within_s`, in every round.
  [[nodiscard]] std::vector<Candidate> All(std::uint32_t unit, double within_s) const;
  /// Ways of the unit through its cell that stay clear of `other`. The way in is clear of where
  /// `other` starts, the way out of where it ends. kNoUnitIndex: of no unit.
  [[nodiscard]] std::vector<Candidate> ViaCell(std::uint32_t unit, std::uint32_t other,
                                               double within_s);
  /// A way for `unit` among what never moves, and `other` where `poses` has it. Empty: there is
  /// none. Shape: `poses` (n).
  /// A question that was asked before costs nothing. Lifetime: until the next call.
  [[nodiscard]] const Way& AmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                                         std::uint32_t other, std::span<const Pose> poses);

  /// The least cost of the candidates from `first` on that end within `within_s`, and which one has
  /// it. Equal costs are drawn by lot. Motions::kNever: none is possible.
  double Cheapest(std::uint32_t unit, double within_s, std::span<const Candidate> candidates,
                  std::size_t first, std::size_t* chosen);
  /// The unit takes the first of the ways, in this order, that meets no other. `ways` loses those
  /// that were tried. False: there is none.
  bool TakeFirstClear(std::uint32_t unit, std::vector<Candidate>* ways);
  /// The unit takes a way that a search in time finds among all others as they move. `attempts`
  /// says how often the unit has looked: later searches are finer and longer. False: none is found.
  bool TakeBySearchInTime(std::uint32_t unit, double end_s, int attempts);

 private:
  [[nodiscard]] Way FindAmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                                      std::uint32_t other, std::span<const Pose> poses);

  /// A way among standing things. Nothing of the question changes during a search.
  struct KnownWay {
    std::uint32_t other = 0;
    const Pose* poses = nullptr;
    Pose from{};
    PoseBox goal;
    Way way;
  };
  Motions& motions_;
  const LocalSearchRequest& q_;
  Rng& rng_;
  TimeSearch time_search_;
  PathSearch path_search_;
  std::vector<std::vector<KnownWay>> known_ways_;  // by unit
  std::vector<MovingNeighbour> moving_;            // scratch
  std::vector<Blocker> blockers_;                  // scratch
};

}  // namespace focalfleet
