// A planned fleet that tests stop in mid-motion, judged by the public plan and the independent
// checker alone.
#pragma once

#include <algorithm>
#include <cstdio>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"
#include "tests/fleet/plan/true_time.h"

namespace focalfleet::test {

inline constexpr double kBeforeS = 0.1;  // walked before the first stop
inline constexpr int kReplanEvery = 20;  // instants

using Units = std::vector<std::uint32_t>;

/// A planned fleet, ready to be stopped again and again.
class Stopped {
 public:
  Stopped(PlanningFleet fleet, Plan plan, const PlanOptions& options)
      : fleet_(std::move(fleet)), plan_(std::move(plan)), options_(options) {
    const std::size_t n = fleet_.layout.size();
    units_ = CheckedUnits(fleet_.layout, fleet_.drives, fleet_.start, fleet_.frozen);
    rows_.resize(n);
    for (const CheckedRow& row : CheckedRows(plan_, fleet_.layout, fleet_.drives))
      rows_[IndexOf(row.unit)].push_back(row);
    move_of_.resize(n, nullptr);
    for (const UnitPlan& move : plan_.moves) move_of_[move.unit.value] = &move;
    clocks_.resize(n);
    stops_.resize(n, kNever);
  }

  void DrawClocks(Rng* rng) {
    for (Clock& clock : clocks_) clock = DrawClock(rng, options_);
  }
  void SetClock(std::uint32_t i, const Clock& clock) { clocks_[i] = clock; }
  void GoOn() { stops_.assign(stops_.size(), kNever); }
  void StopAt(std::uint32_t i, double true_s) { stops_[i] = true_s; }

  [[nodiscard]] bool Moves(std::uint32_t i, double true_s) const {
    return !rows_[i].empty() && BeginOf(i) < true_s && true_s < EndOf(i);
  }
  [[nodiscard]] double EndOf(std::uint32_t i) const {
    double end_s = 0;
    for (const CheckedRow& row : rows_[i]) end_s = std::max(end_s, row.t1_s);
    return clocks_[i].True(end_s);
  }

  /// Stops each unit that may run into those that are stopped, at `stop(when the other ended)`.
  /// Returns how many.
  template <class StopTime>
  int StopFollowers(const StopTime& stop) {
    std::vector<std::uint32_t> open = StoppedOnes();
    int count = 0;
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      if (move_of_[i] == nullptr || stops_[i] >= EndOf(i)) continue;
      for (const UnitPlan::Follower& follower : move_of_[i]->followers) {
        const std::uint32_t j = follower.unit.value;
        if (stops_[i] < follower.since_s || stops_[i] > follower.left_s) continue;
        const double stop_s = stop(stops_[i]);
        if (stops_[j] < kNever || stop_s >= EndOf(j)) continue;
        stops_[j] = stop_s;
        ++count;
        open.push_back(j);
      }
    }
    return count;
  }

  [[nodiscard]] Units StoppedOnes() const {
    Units stopped;
    for (std::uint32_t i = 0; i < stops_.size(); ++i)
      if (stops_[i] < kNever) stopped.push_back(i);
    return stopped;
  }
  [[nodiscard]] Units AllUnits() const {
    Units all(stops_.size());
    std::iota(all.begin(), all.end(), 0u);
    return all;
  }
  [[nodiscard]] Units StoppedAndNeighbours() const {
    std::set<std::uint32_t> concerned;
    for (const std::uint32_t i : StoppedOnes()) {
      concerned.insert(i);
      for (const PositionerIndex j : fleet_.layout.neighbours({i})) concerned.insert(j.value);
    }
    return {concerned.begin(), concerned.end()};
  }

  /// The pairs among `units` that are not clear at some time from `since_s` on. With a
  /// `clearance_mm` other than the layout's: the pairs that come nearer than half-widths and that.
  [[nodiscard]] UnclearPairs Check(const Units& units, double since_s, double clearance_mm,
                                   double tolerance_mm) const {
    std::vector<CheckedUnit> checked;
    std::vector<CheckedRow> rows;
    for (const std::uint32_t i : units) checked.push_back(Lay(i, since_s, &rows));
    CheckOptions options;
    options.clearance_mm = clearance_mm;
    options.tolerance_mm = tolerance_mm;
    options.start_skew_s = options.clock_error = 0;  // in the rows already
    return PairsIn(CheckPlan(std::move(checked), rows, {}, options), fleet_.layout);
  }
  [[nodiscard]] UnclearPairs Check(const Units& units, double since_s) const {
    return Check(units, since_s, fleet_.layout.clearance_mm(), CheckOptions{}.tolerance_mm);
  }
  /// True where the plan itself states that these stops come too late for this pair.
  [[nodiscard]] bool IsUnnoticed(const Pair& pair) const {
    return std::any_of(plan_.unnoticed.begin(), plan_.unnoticed.end(), [&](const Unnoticed& u) {
      const std::uint32_t ends = u.ends.value;
      const std::uint32_t follows = u.follower.value;
      return Pair(std::minmax(ends, follows)) == pair && stops_[ends] >= u.at_s &&
             stops_[follows] > stops_[ends] + u.leaves_s;
    });
  }
  /// The time after the end of one unit at `end_s` that the plan leaves for the stop of the other.
  [[nodiscard]] double LeftS(std::uint32_t ends, std::uint32_t follows, double end_s) const {
    for (const Unnoticed& u : plan_.unnoticed)
      if (u.ends.value == ends && u.follower.value == follows && end_s >= u.at_s)
        return std::min(u.leaves_s, options_.notice_s);
    return options_.notice_s;
  }
  /// The poses when all have stopped: whole vectors.
  [[nodiscard]] std::vector<Pose> Poses() const {
    std::vector<Pose> poses;
    for (std::uint32_t i = 0; i < stops_.size(); ++i) {
      Pose pose = PlaceOf(fleet_.start[i]);
      if (move_of_[i] != nullptr)
        for (std::size_t k = 0; k < kAxisCount; ++k)
          pose[k] = PositionAt(pose[k], move_of_[i]->path[k], fleet_.drives[i].axis[k],
                               clocks_[i].Own(stops_[i]));
      poses.push_back(pose);
    }
    return poses;
  }

  [[nodiscard]] const PlanningFleet& fleet() const { return fleet_; }
  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] const PlanOptions& options() const { return options_; }

  [[nodiscard]] std::string Describe(const Pair& pair) const {
    std::string text = "unit indices " + std::to_string(pair.first) + " (stopped at " +
                       std::to_string(stops_[pair.first]) + " s) and " +
                       std::to_string(pair.second) + " (" + std::to_string(stops_[pair.second]) +
                       " s)";
    for (const auto& [i, j] : {pair, Pair{pair.second, pair.first}}) {
      if (move_of_[i] == nullptr) continue;
      for (const UnitPlan::Follower& f : move_of_[i]->followers)
        if (f.unit.value == j)
          text += "; " + std::to_string(j) + " follows " + std::to_string(i) + " since " +
                  std::to_string(f.since_s) + " begins " + std::to_string(f.begins_s) + " left " +
                  std::to_string(f.left_s);
      for (const Unnoticed& u : plan_.unnoticed)
        if (u.ends.value == i && u.follower.value == j)
          text += "; unnoticed from " + std::to_string(u.at_s) + " leaves " +
                  std::to_string(u.leaves_s);
    }
    return text;
  }

 private:
  [[nodiscard]] std::uint32_t IndexOf(std::uint32_t id) const {
    return fleet_.layout.Find(UnitId{id})->value;
  }
  [[nodiscard]] double BeginOf(std::uint32_t i) const {
    double begin_s = kNever;
    for (const CheckedRow& row : rows_[i]) begin_s = std::min(begin_s, row.t0_s);
    return clocks_[i].True(begin_s);
  }
  /// Appends what is left of the rows between `since_s` and the stop, in true time after
  /// `since_s`; returns the unit as it stands at `since_s`.
  [[nodiscard]] CheckedUnit Lay(std::uint32_t i, double since_s,
                                std::vector<CheckedRow>* rows) const {
    CheckedUnit unit = units_[i];
    LayRows(rows_[i], clocks_[i], 0, since_s, stops_[i], &unit, rows);
    return unit;
  }

  PlanningFleet fleet_;
  Plan plan_;
  PlanOptions options_;
  std::vector<CheckedUnit> units_;
  std::vector<std::vector<CheckedRow>> rows_;  // by the units' own clocks
  std::vector<const UnitPlan*> move_of_;
  std::vector<Clock> clocks_;
  std::vector<double> stops_;  // true time
};

inline bool Touches(const Stopped& fleet, const Pair& pair, double since_s) {
  return !fleet.Check({pair.first, pair.second}, since_s, 1e-9, 0).pairs.empty();
}

inline std::size_t UnnoticedPairs(const Plan& plan) {
  std::set<Pair> pairs;
  for (const Unnoticed& u : plan.unnoticed)
    pairs.insert(std::minmax(u.ends.value, u.follower.value));
  return pairs.size();
}

/// The outcome of many stops.
struct Tally {
  int draws = 0;
  int stopped = 0;
  int stopped_most = 0;
  int unclear = 0;    // pairs that the plan does not except
  int touching = 0;   // of these, pairs whose arms meet
  int unnoticed = 0;  // pairs that the plan excepts, and that were not clear
  int unnoticed_touching = 0;

  void Count(const Stopped& fleet, int followers, double since_s) {
    ++draws;
    stopped += followers;
    stopped_most = std::max(stopped_most, followers);
    const UnclearPairs found = fleet.Check(fleet.StoppedAndNeighbours(), since_s);
    for (const Pair& pair : found.pairs) {
      const bool touches = Touches(fleet, pair, since_s);
      if (fleet.IsUnnoticed(pair)) {
        ++unnoticed;
        unnoticed_touching += touches ? 1 : 0;
        continue;
      }
      ++unclear;
      touching += touches ? 1 : 0;
      if (unclear <= 5)
        std::printf("%s: %s\n%s", touches ? "TOUCH" : "UNCLEAR", fleet.Describe(pair).c_str(),
                    found.text.c_str());
    }
  }
  void Print(const char* what) const {
    std::printf(
        "%s: %d stops, %.2f followers stopped on average, %d at most; pairs unclear %d, touching "
        "%d; of unnoticed pairs unclear %d, touching %d\n",
        what, draws, static_cast<double>(stopped) / std::max(draws, 1), stopped_most, unclear,
        touching, unnoticed, unnoticed_touching);
  }
};

/// From where all stand now, every unit gets to the target that it had.
inline void ExpectANewPlan(const Stopped& fleet, double t_s) {
  PlanningFleet again = fleet.fleet();
  again.StandAt(fleet.Poses());
  const auto plan = MakePlan(again.request(), {.lead_apart = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty()) << "stopped at " << t_s << " s";
  if (plan->too_near.empty()) ExpectSound(again, *plan);
  std::printf("replanned from a stop at %.2f s: %zu moves, %zu unserved, makespan %.2f s%s\n", t_s,
              plan->moves.size(), plan->unserved.size(), plan->makespan_s,
              plan->too_near.empty() ? "" : ", pairs led apart");
}

class StopSafety : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    seed_ = TestSeed(static_cast<std::uint64_t>(GetParam()));
    PlanningFleet fleet = FleetOf(Plate(), {});
    ASSERT_NO_FATAL_FAILURE(DrawStartAndTargets(&fleet, seed_));
    const PlanOptions options = Options();
    auto plan = MakePlan(fleet.request(), options);
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty()) << plan->unserved.size() << " units";
    fleet_.emplace(std::move(fleet), std::move(*plan), options);
  }
  [[nodiscard]] virtual PlanOptions Options() const { return {}; }
  [[nodiscard]] virtual std::vector<Unit> Plate() const { return MakeHexLayout({.count = 5000}); }
  [[nodiscard]] double DrawInstant(Rng* rng) const {
    return rng->Uniform(0, fleet_->plan().makespan_s);
  }

  std::uint64_t seed_ = 0;
  std::optional<Stopped> fleet_;
};

}  // namespace focalfleet::test
