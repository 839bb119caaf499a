// The motions that a local search has chosen so far, one a unit, and which of them conflict.
//
// Two neighbours are in conflict where their motions are not clear of each other for all clocks and
// skews (track.h). Each pair has a weight, which grows each time that the pair stays in conflict.
// The cost of a motion is the sum of the weights of its conflicts.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/local_search.h"

namespace focalfleet {

class Motions {
 public:
  /// The cost of a motion that meets something that never moves.
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  /// No unit has a motion yet. Lifetime: `request` outlives this.
  explicit Motions(const LocalSearchRequest& request);

  [[nodiscard]] const LocalSearchRequest& request() const { return q_; }
  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const AxisPaths& path(std::uint32_t unit) const { return paths_[unit]; }
  [[nodiscard]] const Track& track(std::uint32_t unit) const { return tracks_[unit]; }
  /// Where the arm of `unit` is over time if it takes `path`.
  [[nodiscard]] Track TrackOf(std::uint32_t unit, const AxisPaths& path) const {
    return {scene_.arm(unit), q_.drives[unit], q_.from[unit], path};
  }
  /// The motion of the unit is fixed by the request.
  [[nodiscard]] bool IsGiven(std::uint32_t unit) const {
    return !q_.given.empty() && q_.given[unit] != 0;
  }

  /// The first motion of a unit. Pre: the power ledger holds it already, where there is one.
  void Begin(std::uint32_t unit, const AxisPaths& path);
  /// The unit stands where it is.
  void BeginStanding(std::uint32_t unit);
  /// Replaces the motion of the unit. Pre: `paths` keeps the limits of power; `track` is its track.
  void Replace(std::uint32_t unit, const AxisPaths& paths, Track track);
  void Replace(std::uint32_t unit, const AxisPaths& path) {
    Replace(unit, path, TrackOf(unit, path));
  }
  /// Takes the unit off the plate: no other meets it until its motion is replaced.
  void TakeOut(std::uint32_t unit) { Replace(unit, {}, Track()); }
  [[nodiscard]] bool KeepsLimits(std::uint32_t unit, const AxisPaths& paths) const {
    return q_.ledger == nullptr || q_.ledger->Fits(unit, paths, paths_[unit]);
  }

  /// Which neighbour of `unit` the other is: its position in Scene::neighbours.
  [[nodiscard]] std::uint32_t SlotOf(std::uint32_t unit, std::uint32_t other) const;
  /// With `track`, the unit is in conflict with its neighbour in this slot.
  [[nodiscard]] bool Meets(std::uint32_t unit, const Track& track, std::uint32_t slot) const;
  /// The present motions of the unit and of its neighbour in this slot are in conflict. The answer
  /// is kept until either has another motion.
  [[nodiscard]] bool Meet(std::uint32_t unit, std::uint32_t slot);
  /// Sum of the weights of the neighbours that `track` meets; at least `limit` once that is
  /// reached. kNever: it meets something that never moves.
  double Cost(std::uint32_t unit, const Track& track, double limit);
  /// The present motion of the unit meets a neighbour, or something that never moves.
  [[nodiscard]] bool InConflict(std::uint32_t unit) { return Cost(unit, track(unit), kNever) > 0; }
  /// The pair in this slot weighs 1 more, seen from either unit.
  void AddWeight(std::uint32_t unit, std::uint32_t slot);
  /// Sets the weight of the pair as `unit` sees it. Returns the weight before.
  float ExchangeWeight(std::uint32_t unit, std::uint32_t slot, float weight) {
    return std::exchange(weight_[unit][slot], weight);
  }

  [[nodiscard]] const Tolerance& ToleranceOf(std::uint32_t unit, std::uint32_t slot) const {
    return unnoticed_[unit][slot] != 0 ? without_notice_ : q_.tolerance;
  }
  /// From now on the pair must be clear, but not with notice.
  void GiveUpNotice(std::uint32_t unit, std::uint32_t slot);

  /// Records from now on what each unit did before it was replaced.
  void BeginTrial();
  /// The trial is over. False: a unit that was replaced in it is still in conflict, so all motions
  /// are again as they were when it began.
  bool EndTrial();

  /// Moves the result out. Post: this object may only be destroyed.
  void MoveInto(LocalSearchResult* result);

 private:
  struct Before {
    std::uint32_t unit = 0;
    AxisPaths path;
    Track track;
  };

  const LocalSearchRequest& q_;
  const Scene& scene_;
  Tolerance without_notice_;
  std::vector<AxisPaths> paths_;                      // by unit
  std::vector<Track> tracks_;                         // by unit; no legs: taken out
  std::vector<std::vector<std::uint8_t>> unnoticed_;  // by unit and slot: the pair has no notice
  std::vector<std::vector<float>> weight_;            // by unit and neighbour's slot
  std::vector<std::vector<std::uint32_t>> order_;     // slots, those that mattered last first
  struct Answer {
    std::uint32_t own_count = 0;  // of the motions that both had had when it was found
    std::uint32_t other_count = 0;
    bool known = false;
    bool meet = false;
  };
  std::vector<std::uint32_t> count_;          // by unit: motions that it has had
  std::vector<std::vector<Answer>> answers_;  // by unit and slot
  std::vector<std::uint32_t> met_standing_;   // by unit: the standing thing that was met last
  bool in_trial_ = false;
  std::vector<Before> before_;  // in the order in which units were replaced in the trial
  std::vector<std::vector<std::uint8_t>> unnoticed_before_;
};

/// The present motion of the unit meets something that never moves.
bool MeetsForGood(std::uint32_t unit, Motions* motions);

}  // namespace focalfleet
