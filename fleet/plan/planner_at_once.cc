#include <algorithm>
#include <cmath>
#include <utility>

#include "fleet/plan/bounds.h"
#include "fleet/plan/dense_search.h"
#include "fleet/plan/planner_run.h"
#include "fleet/plan/single_unit_feasibility.h"

namespace focalfleet {
namespace {

constexpr double kLongGiven = 1.02;  // times the bound: given motions up to here do not lengthen it
/// A plan that ends later than this, times the bound, is worth work on its end.
constexpr double kWorthImproving = 1.2;
/// Share of the time beyond which power takes the time, and rails are full.
constexpr double kFullShare = 0.75;
constexpr double kSlackMost = 2;  // times the bound that limits of power may take
/// Work until all are clear of each other, for each unit of the plate: some fifteen times what 500
/// take where nothing stands for good. Units: s of CPU.
constexpr double kCompleteCost_s = 0.03;
constexpr double kCompleteLeast_s = 10;  // of a few units, too: two may be hooked into each other
/// Work that each unit is worth which finds no way with all others. Units: s of CPU.
constexpr double kCallBackCost_s = 1;
/// The first plan of a dense plate ends by this, times the bound.
constexpr double kDenseWithin = 1.25;

}  // namespace

/// Dense plates are searched by neighbourhoods, and so are others where units find no way around
/// each other or the plan ends late.
LocalSearchResult Planner::Search(LocalSearchRequest search, const SearchEffort& effort) const {
  const DenseSearchOptions dense{.within = kDenseWithin,
                                 .complete_cpu_s = effort.complete_cpu_s,
                                 .improve_cpu_s = effort.improves ? options_.improve_cpu_s : 0};
  if (dense_) return SearchDense(search, dense);
  LocalSearchResult made = SearchLocally(search);
  if (made.starved || search.ledger != nullptr || !search.given.empty()) return made;
  double end_s = 0;
  for (const Track& track : made.tracks)
    if (!track.legs().empty()) end_s = std::max(end_s, track.end_s());
  if (made.in_conflict.empty() &&
      (end_s <= kWorthImproving * search.within_s || dense.improve_cpu_s <= 0))
    return made;
  search.begin_with = made.paths;
  LocalSearchResult other = SearchDense(search, dense);
  return other.in_conflict.size() <= made.in_conflict.size() ? other : made;
}

/// Gives up units of a dense plate that those which never move leave no way: each would keep many
/// others in conflict. True: there was one.
bool Planner::AbandonWalledIn() {
  stuck_.clear();
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    const auto near = scene_.neighbours(i);
    const auto never_moves = [&](const NeighbourNeed& n) {
      return !service_.is_movable(n.unit) && !service_.is_given(n.unit);
    };
    if (service_.goes(i) && std::any_of(near.begin(), near.end(), never_moves)) stuck_.push_back(i);
  }
  return AbandonHopeless();
}

/// Plans all units at once. False: some units still meet others, and nothing is planned.
bool Planner::AllAtOnce(std::span<const AxisPaths> begin_with, const SearchEffort& effort) {
  std::vector<std::uint8_t> may_move(service_.movable().begin(), service_.movable().end());
  if (options_.fixed)
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (!request_.targets[i]) may_move[i] = 0;
  std::vector<AxisPaths> paths(begin_with.begin(), begin_with.end());
  std::uint64_t fresh_starts = 0;
  double slack = 0;  // of the time with limits of power; 0: not known yet
  SearchEffort left = effort;
  if (!options_.power.any())
    left.complete_cpu_s =
        std::min(left.complete_cpu_s,
                 std::max(kCompleteLeast_s, kCompleteCost_s * static_cast<double>(scene_.size())));
  for (int attempt = 0; attempt < kAttemptsMax && !IsAbandoned(options_.abandoned); ++attempt) {
    service_.DropCollidingTargets();
    scene_.AllowFor(start_);
    scene_.AllowFor(service_.goals());
    if (options_.lead_apart) scene_.LeadApartThroughout(start_);
    if (dense_ && attempt == 0 && AbandonWalledIn()) continue;
    const Tolerance tolerance{options_.start_skew_s, options_.clock_error, options_.notice_s};
    std::optional<PowerLedger> ledger;
    double within_s = std::max(TimeBoundS(service_), options_.within_s);
    // A dense search takes the time of the ways that it begins with, and then cuts it.
    if (!dense_) within_s = std::max(within_s, plan_.makespan_s);
    // Each turn of sectors may take a little longer than its bound: the excess must not add up.
    if (service_.given_end_s() > kLongGiven * within_s) within_s = service_.given_end_s();
    if (options_.power.any()) {
      ledger.emplace(layout_, request_.drives, options_.motor, options_.power, tolerance);
      // Where power takes the time, full rails leave no room to give way.
      const double power_s = PowerBoundS(service_, options_.power, &*ledger);
      if (slack == 0) slack = power_s > kFullShare * within_s ? 1.3 : 1.02;
      within_s = std::min(std::max(within_s, power_s) * slack, kOffsetMaxS);
    }
    const LocalSearchRequest search{.scene = &scene_,
                                    .drives = request_.drives,
                                    .from = start_,
                                    .to = service_.goals(),
                                    .movable = may_move,
                                    .begin_with = paths,
                                    .given = request_.given,
                                    .ledger = ledger ? &*ledger : nullptr,
                                    .tolerance = tolerance,
                                    .within_s = within_s,
                                    .seed = options_.seed + fresh_starts,
                                    .abandoned = options_.abandoned};
    local_search_ = Search(search, left);
    if (local_search_.starved) break;
    if (local_search_.in_conflict.empty()) {
      PlanOfLocalSearch();
      return true;
    }
    // Some units may have no way at all: they stay, and the others are planned again.
    stuck_ = local_search_.in_conflict;
    std::erase_if(stuck_, [&](std::uint32_t i) { return !service_.is_movable(i); });
    left.complete_cpu_s -= local_search_.work_s;
    if (AbandonHopeless()) continue;
    if (left.complete_cpu_s <= 0) break;
    // The others may need more time within limits of power, or other random numbers.
    if (ledger) slack *= 1.1;
    if (ledger ? slack > kSlackMost : ++fresh_starts > effort.fresh_starts) break;
    if (!options_.power.any()) paths = local_search_.paths;
  }
  tried_ = std::move(local_search_.paths);
  local_search_ = {};
  return false;
}

/// Targets that are lost where the unit rests: its own, and those of others that its resting place
/// keeps them from.
std::size_t Planner::LostIfAtRest(std::uint32_t unit) const {
  Service trial = service_;
  if (trial.goes(unit)) trial.Unserve(unit, UnservedWhy::kBlocked, kNoUnitIndex);
  trial.DropCollidingTargets();
  std::size_t lost = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    lost += service_.goes(i) && !trial.goes(i) ? 1u : 0u;
  return lost;
}

/// Plans all units at once again, without those that made it fail. False: they are too many, or do
/// not move; nothing has changed then.
bool Planner::LeaveStuck(const SearchEffort& effort) {
  constexpr int kTimes = 8;
  const Service before = service_;
  for (int time = 0; time < kTimes && !stuck_.empty(); ++time) {
    // Only one unit of each cluster rests at a time, the one that costs fewest targets: with it at
    // rest the others may find a way.
    std::vector<std::pair<std::size_t, std::uint32_t>> order;
    for (const std::uint32_t i : stuck_) order.emplace_back(LostIfAtRest(i), i);
    std::sort(order.begin(), order.end());
    std::vector<std::uint8_t> stays(scene_.size(), 0);
    for (const auto& [lost, i] : order) {
      const auto near = scene_.neighbours(i);
      const auto is_at_rest = [&](const NeighbourNeed& n) { return stays[n.unit] != 0; };
      if (std::any_of(near.begin(), near.end(), is_at_rest)) continue;
      stays[i] = 1;
      if (service_.goes(i)) service_.Unserve(i, UnservedWhy::kBlocked, InTheWayOf(service_, i));
      service_.Hold(i);
    }
    stuck_.clear();
    if (AllAtOnce(dense_ ? tried_ : request_.motions, effort)) return true;
  }
  service_ = before;
  return false;
}

std::vector<AxisPaths> Planner::PathsOfPlan() const {
  std::vector<AxisPaths> paths(scene_.size());
  for (const UnitPlan& move : plan_.moves) paths[move.unit.value] = move.path;
  return paths;
}

/// Plans as AllAtOnce, with these units served again. False: nothing has changed.
bool Planner::AlsoServe(std::span<const std::uint32_t> units, const SearchEffort& effort) {
  const Service service = service_;
  const Plan plan = plan_;
  LocalSearchResult found = local_search_;
  for (const std::uint32_t i : units) service_.Readmit(i);
  if (AllAtOnce(PathsOfPlan(), effort)) return true;
  service_ = service;
  plan_ = plan;
  local_search_ = std::move(found);
  return false;
}

/// Plans a dense plate without the units that make the search fail, then each of them among the
/// others as these are planned. False: nothing has changed.
bool Planner::LeaveStuckAndCallBack() {
  const Service before = service_;
  constexpr SearchEffort kLittle{
      .fresh_starts = 0, .complete_cpu_s = kCallBackCost_s, .improves = false};
  if (!LeaveStuck(kLittle)) return false;
  const auto is_left = [&](std::uint32_t unit) {
    return before.goes(unit) && !service_.goes(unit);
  };
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (is_left(i)) AlsoServe({&i, 1}, kLittle);
  // A unit at rest may be what keeps another one from its target.
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (!is_left(i)) continue;
    std::vector<std::uint32_t> together{i};
    for (const NeighbourNeed& near : scene_.neighbours(i))
      if (is_left(near.unit)) together.push_back(near.unit);
    if (together.size() > 1) AlsoServe(together, kLittle);
  }
  AlsoServe({}, {});
  return true;
}

void Planner::PlanOfLocalSearch() {
  plan_ = {};
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    const AxisPaths& paths = local_search_.paths[i];
    if (paths[0].size() + paths[1].size() == 0) continue;
    UnitPlan unit{.unit = {i},
                  .from = start_[i],
                  .to = service_.goal(i),
                  .mode = request_.drives[i].mode,
                  .path = paths,
                  .followers = {}};
    plan_.makespan_s = std::max(plan_.makespan_s, EndOf(unit, request_.drives[i]));
    plan_.moves.push_back(std::move(unit));
  }
}

}  // namespace focalfleet
