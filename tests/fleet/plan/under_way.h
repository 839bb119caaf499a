// A configuration under way, for tests of the replanner. The independent checker judges it in true
// time. Every unit runs by a clock of its own within the tolerance, and the late one starts by a
// signal that is early or late. The rows alone give the place of each unit at each time.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "fleet/estimate.h"
#include "fleet/plan/replan.h"
#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"
#include "tests/fleet/plan/true_time.h"

namespace focalfleet::test {

/// A configuration under way in true time: the units that were stopped and when, and the late
/// moves.
class UnderWay {
 public:
  UnderWay(PlanningFleet fleet, const PlanOptions& options, Plan plan)
      : fleet_(std::make_shared<const PlanningFleet>(std::move(fleet))),
        options_(options),
        plan_(std::make_shared<const Plan>(std::move(plan))),
        running_(std::make_shared<const RunningPlan>(fleet_->request(), plan_->moves, options)),
        move_of_(fleet_->layout.size(), nullptr) {
    for (const UnitPlan& move : plan_->moves) move_of_[move.unit.value] = &move;
    Reset();
  }

  [[nodiscard]] const PlanningFleet& fleet() const { return *fleet_; }
  [[nodiscard]] const Plan& plan() const { return *plan_; }
  [[nodiscard]] const RunningPlan& running() const { return *running_; }
  [[nodiscard]] std::uint32_t size() const {
    return static_cast<std::uint32_t>(fleet_->layout.size());
  }

  void Reset() {
    clocks_.assign(size(), {});
    stops_.assign(size(), kNever);
    stands_.clear();
    late_.clear();
    extra_.clear();
  }
  /// Sets all clocks to one corner of the tolerance.
  void SetClocks(int corner) {
    clocks_.assign(size(),
                   {(corner & 1) != 0 ? options_.start_skew_s : -options_.start_skew_s,
                    1 + ((corner & 2) != 0 ? options_.clock_error : -options_.clock_error)});
  }
  void DrawClocks(Rng* rng, int corner) {
    if (corner > 0) return SetClocks(corner);
    for (Clock& clock : clocks_) clock = DrawClock(rng, options_);
  }
  [[nodiscard]] bool Moves(std::uint32_t i, double true_s) const {
    return move_of_[i] != nullptr && true_s < EndOf(i) && true_s < stops_[i];
  }
  [[nodiscard]] double EndOf(std::uint32_t i) const {
    return clocks_[i].True(focalfleet::EndOf(*move_of_[i], fleet_->drives[i]));
  }
  void Stop(std::uint32_t i, double true_s) { stops_[i] = true_s; }

  /// Stops each unit that `first` leads, and those that these lead, by the plan and by late moves.
  /// `stop` gives the time of the stop for the time when the unit before ended.
  template <class StopTime>
  void StopFollowers(std::uint32_t first, const StopTime& stop) {
    std::vector<std::uint32_t> open{first};
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      std::vector<UnitPlan::Follower> followers = extra_[i];
      if (const auto late = late_.find(i); late != late_.end()) {
        const auto& own = late->second.move.move.followers;
        followers.insert(followers.end(), own.begin(), own.end());
      } else if (move_of_[i] != nullptr) {
        followers.insert(followers.end(), move_of_[i]->followers.begin(),
                         move_of_[i]->followers.end());
      }
      const double ended_s = StopOf(i);
      for (const UnitPlan::Follower& follower : followers) {
        const std::uint32_t j = follower.unit.value;
        if (ended_s < follower.since_s || ended_s > follower.left_s) continue;
        if (StopOf(j) < kNever) continue;
        if (late_.count(j) != 0) {
          late_[j].stop_s = stop(ended_s);
        } else {
          if (!Moves(j, stop(ended_s))) continue;
          stops_[j] = stop(ended_s);
        }
        open.push_back(j);
      }
    }
  }
  [[nodiscard]] double StopOf(std::uint32_t i) const {
    const auto late = late_.find(i);
    return late != late_.end() ? late->second.stop_s : stops_[i];
  }

  /// Fixes the places of the stopped units, as a coordinator learns them.
  void Settle() {
    for (std::uint32_t i = 0; i < size(); ++i)
      if (stops_[i] < kNever && late_.count(i) == 0) stands_[i] = PoseAt(i, stops_[i]);
  }
  [[nodiscard]] std::vector<Deviation> Deviations() const {
    std::vector<Deviation> deviations;
    for (const auto& [i, pose] : stands_)
      if (late_.count(i) == 0)
        deviations.push_back({{i}, Exactly(Witness::kReported, pose), std::nullopt});
    for (const auto& [i, late] : late_) deviations.push_back({{i}, {}, late.move});
    return deviations;
  }
  [[nodiscard]] Pose PoseAt(std::uint32_t i, double true_s) const {
    Pose pose = PlaceOf(fleet_->start[i]);
    for (std::size_t k = 0; k < kAxisCount && move_of_[i] != nullptr; ++k)
      pose[k] = PositionAt(pose[k], move_of_[i]->path[k], fleet_->drives[i].axis[k],
                           clocks_[i].Own(true_s));
    return pose;
  }
  [[nodiscard]] Pose PlannedEnd(std::uint32_t i) const { return move_of_[i]->to; }
  [[nodiscard]] Pose EndPose(std::uint32_t i) const {
    if (const auto it = stands_.find(i); it != stands_.end()) return it->second;
    return move_of_[i] != nullptr ? move_of_[i]->to : PlaceOf(fleet_->start[i]);
  }
  void Go(const LateMove& move, const Clock& clock) {
    const std::uint32_t i = move.move.unit.value;
    late_[i] = {move, clock, kNever};
    for (const LateMove::Leader& leader : move.leaders)
      extra_[leader.unit.value].push_back(leader.follower);
  }
  void SetLateClock(std::uint32_t i, const Clock& clock) { late_[i].clock = clock; }
  void StopLate(std::uint32_t i, double true_s) { late_[i].stop_s = true_s; }

  /// The pairs with one of `units` that are not clear at some time from `since_s` on, when all
  /// that stand by then have settled.
  [[nodiscard]] UnclearPairs Unclear(const std::set<std::uint32_t>& units, double since_s) const {
    std::set<std::uint32_t> near = units;
    for (const std::uint32_t i : units)
      for (const PositionerIndex j : fleet_->layout.neighbours({i})) near.insert(j.value);
    const auto all = CheckedUnits(fleet_->layout, fleet_->drives, fleet_->start, fleet_->frozen);
    std::vector<CheckedUnit> checked;
    std::vector<CheckedRow> rows;
    for (const std::uint32_t i : near) {
      checked.push_back(all[i]);
      Lay(i, since_s, &checked.back(), &rows);
    }
    CheckOptions options;
    options.clearance_mm = fleet_->layout.clearance_mm();
    options.start_skew_s = options.clock_error = 0;  // in the rows already
    UnclearPairs unclear = PairsIn(
        CheckPlan(checked, rows, CheckedObstacles(fleet_->layout), options), fleet_->layout);
    std::erase_if(unclear.pairs, [&](const Pair& pair) {
      return units.count(pair.first) + units.count(pair.second) == 0;
    });
    return unclear;
  }
  [[nodiscard]] bool IsUnnoticed(const Pair& pair) const {
    const auto is = [&](const Unnoticed& u) {
      return Pair(std::minmax(u.ends.value, u.follower.value)) == pair;
    };
    if (std::any_of(plan_->unnoticed.begin(), plan_->unnoticed.end(), is)) return true;
    return std::any_of(late_.begin(), late_.end(), [&](const auto& entry) {
      const auto& unnoticed = entry.second.move.unnoticed;
      return std::any_of(unnoticed.begin(), unnoticed.end(), is);
    });
  }

 private:
  struct Late {
    LateMove move;
    Clock clock;
    double stop_s = kNever;
  };
  /// The rest of its rows from `since_s` on, in true time after that.
  void Lay(std::uint32_t i, double since_s, CheckedUnit* unit,
           std::vector<CheckedRow>* rows) const {
    const auto lay = [&](const UnitPlan& move, const Clock& clock, double offset_s, double stop_s) {
      Plan one;
      one.moves.push_back(move);
      LayRows(CheckedRows(one, fleet_->layout, fleet_->drives), clock, offset_s, since_s, stop_s,
              unit, rows);
    };
    if (const auto stands = stands_.find(i); stands != stands_.end()) {
      for (std::size_t k = 0; k < kAxisCount; ++k)
        unit->axis[k].start_deg =
            DegreesOf(stands->second[k], fleet_->layout.unit({i}), fleet_->drives[i], k);
    } else if (move_of_[i] != nullptr && late_.count(i) == 0) {
      lay(*move_of_[i], clocks_[i], 0, stops_[i]);
    } else if (move_of_[i] != nullptr) {  // the unit had arrived
      lay(*move_of_[i], clocks_[i], 0, kNever);
    }
    if (const auto late = late_.find(i); late != late_.end())
      lay(late->second.move.move, late->second.clock, late->second.move.start_s,
          late->second.stop_s);
  }

  std::shared_ptr<const PlanningFleet> fleet_;
  PlanOptions options_;
  std::shared_ptr<const Plan> plan_;
  std::shared_ptr<const RunningPlan> running_;
  std::vector<const UnitPlan*> move_of_;
  std::vector<Clock> clocks_;
  std::vector<double> stops_;  // true time, of the planned move
  std::map<std::uint32_t, Pose> stands_;
  std::map<std::uint32_t, Late> late_;
  std::map<std::uint32_t, std::vector<UnitPlan::Follower>> extra_;
};

/// True: the planner finds a way while all others are where they end.
inline bool HasStaticWay(const UnderWay& fleet, const ReplanQuestion& question) {
  PlanningFleet then = fleet.fleet();
  for (std::uint32_t i = 0; i < fleet.size(); ++i) {
    then.start[i] = Exactly(Witness::kReported, fleet.EndPose(i));
    then.frozen[i] = 1;
    then.targets[i].reset();
  }
  const std::uint32_t unit = question.unit.value;
  then.start[unit] = Exactly(Witness::kReported, question.from);
  then.frozen[unit] = 0;
  then.targets[unit] = question.to;
  const auto plan = MakePlan(then.request(), {.fixed = true});
  return plan && plan->unserved.empty();
}

/// A place where `unit` is clear of where all others end.
inline std::optional<Pose> DrawTarget(const UnderWay& fleet, std::uint32_t unit, const Rng& rng) {
  std::vector<std::optional<Pose>> standing(fleet.size());
  for (std::uint32_t i = 0; i < fleet.size(); ++i)
    if (i != unit) standing[i] = fleet.EndPose(i);
  const auto drawn = DrawConfiguration(fleet.fleet().layout, fleet.fleet().drives, standing, rng);
  if (!drawn) return std::nullopt;
  return (*drawn)[unit];
}

/// The late move is clear at all corners of the late unit's own clock.
inline void ExpectClear(UnderWay* fleet, const LateMove& late, double since_s) {
  for (const double skew : {-late.start_skew_s, late.start_skew_s}) {
    for (const double rate : {0.995, 1.005}) {
      fleet->Go(late, {skew, rate});
      const UnclearPairs unclear = fleet->Unclear({late.move.unit.value}, since_s);
      EXPECT_TRUE(unclear.pairs.empty())
          << "unit index " << late.move.unit.value << " starts at " << late.start_s << " s:\n"
          << unclear.text;
    }
  }
}
/// True: the late move would meet another if its start were this much beyond its skew.
inline bool WouldMeet(UnderWay* fleet, const LateMove& late, double since_s, double beyond_s) {
  bool meets = false;
  for (const double skew : {-late.start_skew_s - beyond_s, late.start_skew_s + beyond_s}) {
    fleet->Go(late, {skew, 1});
    meets = meets || !fleet->Unclear({late.move.unit.value}, since_s).pairs.empty();
  }
  return meets;
}

inline std::optional<UnderWay> Begun(std::uint32_t count, std::uint64_t seed,
                                     PlanOptions options = {}) {
  PlanningFleet fleet = HexFleet(count);
  DrawStartAndTargets(&fleet, seed);
  // Some units have nothing to do yet: their targets come later.
  Rng rng = Rng::Stream(seed, "idle");
  std::vector<std::optional<Pose>> standing(count);
  for (std::uint32_t i = 0; i < count; ++i)
    if (rng.Below(12) == 0) standing[i] = PlaceOf(fleet.start[i]);
  const auto to =
      DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(seed, "targets"));
  EXPECT_TRUE(to);
  if (!to) return std::nullopt;
  for (std::uint32_t i = 0; i < count; ++i) {
    fleet.targets[i].reset();
    if (!standing[i]) fleet.targets[i] = (*to)[i];
  }
  auto plan = MakePlan(fleet.request(), options);
  EXPECT_TRUE(plan) << plan.error().text;
  if (!plan) return std::nullopt;
  return std::optional<UnderWay>(std::in_place, std::move(fleet), options, std::move(*plan));
}

}  // namespace focalfleet::test
