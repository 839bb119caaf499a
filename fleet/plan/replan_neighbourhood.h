// The things near one unit that is planned again: its neighbours as they move or stand from now on.
// A motion of the unit is tested against them here.
//
// Times are seconds after the start signal of the configuration, as in replan.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/replan.h"
#include "fleet/plan/track.h"

namespace focalfleet {

/// The tick of 100 us that is nearest to a time. Units: s.
std::uint32_t TicksOf(double t_s);

class ReplanNeighbourhood {
 public:
  /// A neighbour with a place, in the configuration's time.
  struct Other {
    std::uint32_t unit = 0;
    Track track;
    Pose ends{};
    double skew_s = 0;
    double need_mm = 0;
    Tolerance tolerance;    // of the pair, with notice
    std::uint32_t met = 0;  // motions that were refused because of it
  };

  /// Lifetime: `running` and `question` outlive this.
  ReplanNeighbourhood(const RunningPlan& running, const ReplanQuestion& question);

  /// Finds the neighbours. Pre: the unit of the question is one of the layout.
  void LookAround(std::span<const Deviation> deviations);

  /// The neighbours that have a place. Shape: as LookAround found them.
  [[nodiscard]] std::span<const Other> others() const { return others_; }
  /// Things that stand for good: obstacles, and covers of units of uncertain place.
  [[nodiscard]] std::span<const Blocker> standing() const { return standing_; }
  [[nodiscard]] Tolerance ToleranceOf(const Other& other, bool with_notice) const;
  /// The time by which each neighbour is where it stays. Units: s.
  [[nodiscard]] double OthersEnd() const;

  /// The target is clear for good of the places where the others end, or stand. Errors: kInvalid,
  /// with every one that it is not clear of.
  [[nodiscard]] Status CheckTarget() const;
  /// From now on the motion is clear of all others. False: what it meets is counted.
  bool IsClear(const Track& track, bool with_notice);
  /// How many motions met things that stand, and how many the neighbour that was met most.
  [[nodiscard]] std::uint32_t things_met() const { return things_met_; }
  [[nodiscard]] std::uint32_t most_met() const;
  /// Names what was met most often, as the end of a message. Empty: no motion met anything.
  [[nodiscard]] std::string InTheWay() const;

 private:
  void AddOther(const NeighbourNeed& near, const Deviation* deviation);
  void AddCover(const NeighbourNeed& near, const UnitKnowledge& knowledge);
  void AllowFor(Other* other, const Pose& starts) const;
  [[nodiscard]] const Other* MostMet() const;
  [[nodiscard]] const ArmGeometry& arm() const;

  const RunningPlan& running_;
  const Scene& scene_;
  const ReplanQuestion& q_;
  std::vector<Other> others_;
  std::vector<std::size_t> order_;  // of others_, those that were met last first
  std::vector<Blocker> standing_;
  std::uint32_t things_met_ = 0;
  std::uint32_t thing_ = kNoUnitIndex;  // met last, of those that stand for good
};

}  // namespace focalfleet
