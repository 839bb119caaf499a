#include <algorithm>
#include <cmath>
#include <limits>

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
/// Work until all are clear of each other, for each unit that goes: some fifteen times what 500
/// take where nothing stands for good. Units: s of CPU.
constexpr double kCompleteCost_s = 0.03;
constexpr double kCompleteLeast_s = 10;  // of a few units, too: two may be hooked into each other
/// Repeats with other random numbers, without limits of power.
constexpr std::uint64_t kFreshStarts = 3;
/// The first plan of a dense plate ends by this, times the bound.
constexpr double kDenseWithin = 1.25;

}  // namespace

/// Dense plates are searched by neighbourhoods, and so are others where units find no way around
/// each other or the plan ends late.
LocalSearchResult Planner::Search(LocalSearchRequest search, double complete_cpu_s) const {
  const DenseSearchOptions dense{.within = kDenseWithin,
                                 .complete_cpu_s = complete_cpu_s,
                                 .improve_cpu_s = options_.improve_cpu_s};
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
  const bool any = AbandonHopeless();
  stuck_.clear();
  return any;
}

std::size_t Planner::CountGoing() const {
  std::size_t going = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) going += service_.goes(i) ? 1u : 0u;
  return going;
}

/// Plans all units at once. False: some units still meet others, and nothing is planned.
bool Planner::AllAtOnce(std::span<const AxisPaths> begin_with) {
  std::vector<std::uint8_t> may_move(service_.movable().begin(), service_.movable().end());
  if (options_.fixed)
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (!request_.targets[i]) may_move[i] = 0;
  std::vector<AxisPaths> paths(begin_with.begin(), begin_with.end());
  std::uint64_t fresh_starts = 0;
  double slack = 0;  // of the time with limits of power; 0: not known yet
  // Limits of power have attempts of their own, each with more time.
  double left_cpu_s =
      options_.power.any()
          ? std::numeric_limits<double>::infinity()
          : std::max(kCompleteLeast_s, kCompleteCost_s * static_cast<double>(CountGoing()));
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
    local_search_ = Search(search, left_cpu_s);
    if (local_search_.starved) break;
    if (local_search_.in_conflict.empty()) {
      PlanOfLocalSearch();
      return true;
    }
    // Some units may have no way at all: they stay, and the others are planned again.
    stuck_ = local_search_.in_conflict;
    std::erase_if(stuck_, [&](std::uint32_t i) { return !service_.is_movable(i); });
    left_cpu_s -= local_search_.work_s;
    if (AbandonHopeless()) continue;
    if (left_cpu_s <= 0) break;
    // The others may need more time within limits of power, or other random numbers.
    if (ledger) slack *= 1.1;
    if (ledger ? slack > kSlackMost : ++fresh_starts > kFreshStarts) break;
    if (!options_.power.any()) paths = local_search_.paths;
  }
  local_search_ = {};
  return false;
}

/// Plans all units at once again, without those that made it fail. False: they are too many, or do
/// not move; nothing has changed then.
bool Planner::LeaveStuck() {
  constexpr int kTimes = 8;
  const Service before = service_;
  for (int time = 0; time < kTimes && !stuck_.empty(); ++time) {
    // Only one unit of each cluster rests at a time: with it at rest the others may find a way.
    std::vector<std::uint8_t> stays(scene_.size(), 0);
    for (const std::uint32_t i : stuck_) {
      const auto near = scene_.neighbours(i);
      const auto is_at_rest = [&](const NeighbourNeed& n) { return stays[n.unit] != 0; };
      if (std::any_of(near.begin(), near.end(), is_at_rest)) continue;
      stays[i] = 1;
      if (service_.goes(i)) service_.Unserve(i, UnservedWhy::kBlocked, InTheWayOf(service_, i));
      service_.Hold(i);
    }
    stuck_.clear();
    if (AllAtOnce(request_.motions)) return true;
  }
  service_ = before;
  return false;
}

/// Plans units that found no turn in the order among the others as these are planned. On a dense
/// plate all end sooner then.
void Planner::ServeTheRest() {
  const Service before = service_;
  const Plan ordered = plan_;
  std::vector<AxisPaths> paths(scene_.size());
  for (const UnitPlan& move : plan_.moves) paths[move.unit.value] = move.path;
  for (const std::uint32_t i : stuck_for_order_) service_.Readmit(i);
  if (AllAtOnce(paths)) return;
  service_ = before;
  plan_ = ordered;
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
