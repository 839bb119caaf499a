#include "fleet/plan/planner.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "fleet/plan/bounds.h"
#include "fleet/plan/dense_search.h"
#include "fleet/plan/guarantee.h"
#include "fleet/plan/in_cell_planner.h"
#include "fleet/plan/local_search.h"
#include "fleet/plan/objective.h"
#include "fleet/plan/pair_bound.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/schedule.h"
#include "fleet/plan/sequential_planner.h"
#include "fleet/plan/service.h"
#include "fleet/plan/single_unit_feasibility.h"

namespace focalfleet {
namespace {

/// Each attempt takes at least one unit out of the served ones or lets at least one be moved aside.
/// After so many attempts the fleet is planned with what can be served without moving any unit
/// aside.
constexpr int kAttemptsMax = 60;
constexpr std::size_t kTightest = 20;  // pairs that Plan::tightest lists
/// Repeats with other random numbers, without limits of power.
constexpr std::uint64_t kFreshStarts = 3;
constexpr double kLongGiven = 1.02;  // times the bound: given motions up to here do not lengthen it
/// A plan that ends later than this, times the bound, is worth work on its end.
constexpr double kWorthImproving = 1.2;
constexpr double kNearBound = 1.03;  // times the bound
/// Share of the time beyond which power takes the time, and rails are full.
constexpr double kFullShare = 0.75;
constexpr double kSlackMost = 2;  // times the bound that limits of power may take
/// With more neighbours than this on average a unit hardly ever finds all others out of its way:
/// many are planned anew together.
constexpr double kDenseNeighbours = 10;
/// The first plan of a dense plate ends by this, times the bound.
constexpr double kDenseWithin = 1.25;

std::vector<Pose> StartsOf(const PlanRequest& request) {
  std::vector<Pose> starts;
  starts.reserve(request.start.size());
  for (const UnitKnowledge& k : request.start) starts.push_back(IsPlace(k) ? PlaceOf(k) : Pose{});
  return starts;
}

class Planner {
 public:
  Planner(const PlanRequest& request, const PlanOptions& options)
      : request_(request),
        options_(options),
        layout_(*request.layout),
        start_(StartsOf(request)),
        scene_(layout_, request.drives, request.start, request.offsets),
        surroundings_(&scene_, start_, options.abandoned),
        service_(request, scene_, start_),
        aside_(scene_.size(), 0),
        by_itself_(scene_.size(), 0),
        hopeful_(scene_.size(), 0),
        dense_(MeanNeighbours() > kDenseNeighbours) {}

  Result<Plan> Run();
  [[nodiscard]] Status Check() const;

 private:
  Result<Plan> AmongGiven();
  bool Attempt(std::vector<Piece>* order);
  void GiveWay();
  void Abandon(std::uint32_t unit, std::optional<NoWay> proof = std::nullopt);
  bool AbandonHopeless();
  bool LetStepAside(std::uint32_t stuck);
  [[nodiscard]] Status CheckWanted() const;
  [[nodiscard]] double MeanNeighbours() const;
  [[nodiscard]] LocalSearchResult Search(LocalSearchRequest search) const;
  bool AllAtOnce(std::span<const AxisPaths> begin_with);
  bool LeaveStuck();
  void PlanOfLocalSearch();
  void TracksOfPlan();
  void ServeTheRest();
  void FindBounds();
  Plan Finish();

  const PlanRequest& request_;
  const PlanOptions& options_;
  const Layout& layout_;
  const std::vector<Pose> start_;  // of units without a place: meaningless
  Scene scene_;
  Surroundings surroundings_;
  Service service_;
  std::string too_near_;  // pairs that start so, by name
  std::vector<std::uint8_t> aside_;
  std::vector<std::uint8_t> by_itself_;  // goes from start to target in one way, not by its cell
  std::vector<std::uint8_t> hopeful_;    // CanEver has returned true for it
  std::vector<std::uint8_t> movers_;
  std::vector<std::uint32_t> stuck_;
  std::vector<std::uint32_t> stuck_for_order_;  // given up though a way exists
  bool dense_ = false;
  LocalSearchResult local_search_;  // tracks of plan_
  Plan plan_;
};

Status CheckShapes(const PlanRequest& request) {
  if (request.layout == nullptr) return Fail(ErrorCode::kInvalid, "a plan needs a layout");
  const std::size_t n = request.layout->size();
  const auto fits = [n](std::size_t size) { return size == 0 || size == n; };
  if (!fits(request.motions.size()) || !fits(request.given.size()) ||
      request.given.size() > request.motions.size())
    return Fail(ErrorCode::kInvalid, "motions and given must be empty or have one row a unit");
  if (request.drives.size() == n && request.start.size() == n && request.targets.size() == n &&
      request.frozen.size() == n)
    return {};
  return Fail(ErrorCode::kInvalid,
              "drives, start, targets and frozen must have one row for each of the " +
                  std::to_string(n) + " units");
}

Piece BackOf(const Piece& piece) {
  return {piece.unit, {piece.sweep.to, piece.sweep.from, piece.sweep.out_of_step}};
}

/// Every target is in reach, and no unit starts or ends nearer to another than allowed.
Status Planner::Check() const {
  std::string text = service_.TargetsOutOfRange();
  const auto add = [&text](const std::string& more) {
    text += (text.empty() || more.empty() ? "" : "; ") + more;
  };
  if (!options_.lead_apart) add(service_.StartsTooNear());
  if (!options_.leave_stuck) add(service_.TargetsTooNear());
  return text.empty() ? Status{} : Fail(ErrorCode::kInvalid, text);
}

/// Makes one whole attempt: in, turn, out. False: stuck_ has the units that found no way.
bool Planner::Attempt(std::vector<Piece>* order) {
  order->clear();
  stuck_.clear();
  movers_.assign(scene_.size(), 0);
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    movers_[i] =
        service_.is_movable(i) && (service_.goal(i) != start_[i] || aside_[i] != 0) ? 1 : 0;
  std::vector<std::uint8_t> by_cell = movers_;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (by_itself_[i] != 0) by_cell[i] = 0;
  SequentialPlanner in(&scene_, request_.drives, &surroundings_, start_, by_cell);
  in.Run();
  SequentialPlanner out(&scene_, request_.drives, &surroundings_, service_.goals(), by_cell);
  out.Run();
  stuck_ = in.stuck();
  stuck_.insert(stuck_.end(), out.stuck().begin(), out.stuck().end());
  if (stuck_.empty()) {
    InCellPlanner turn(&scene_, request_.drives, &surroundings_, in.poses(), out.poses());
    turn.Run();
    stuck_ = turn.stuck();
    *order = in.pieces();
    order->insert(order->end(), turn.pieces().begin(), turn.pieces().end());
    std::transform(out.pieces().rbegin(), out.pieces().rend(), std::back_inserter(*order),
                   [](const Piece& piece) { return BackOf(piece); });
    const std::vector<std::uint32_t> too_many = UnitsWithTooManyPieces(*order, scene_.size());
    stuck_.insert(stuck_.end(), too_many.begin(), too_many.end());
  }
  std::sort(stuck_.begin(), stuck_.end());
  stuck_.erase(std::unique(stuck_.begin(), stuck_.end()), stuck_.end());
  return stuck_.empty();
}

bool Planner::LetStepAside(std::uint32_t stuck) {
  bool added = false;
  for (const NeighbourNeed& near : scene_.neighbours(stuck)) {
    const std::uint32_t j = near.unit;
    if (!service_.is_movable(j) || movers_[j] != 0 || aside_[j] != 0 || !scene_.HasCell(j))
      continue;
    if (options_.fixed && !request_.targets[j]) continue;
    aside_[j] = 1;
    added = true;
  }
  return added;
}

void Planner::Abandon(std::uint32_t unit, std::optional<NoWay> proof) {
  if (service_.goes(unit)) {
    if (hopeful_[unit] != 0) stuck_for_order_.push_back(unit);
    service_.Unserve(unit, UnservedWhy::kBlocked, InTheWayOf(service_, unit), std::move(proof));
  } else
    service_.Hold(unit);
  aside_[unit] = 0;
  by_itself_[unit] = 0;
}

/// Gives up stuck units that no order of moves can help. True: there was one.
bool Planner::AbandonHopeless() {
  bool any = false;
  for (const std::uint32_t i : stuck_) {
    if (IsAbandoned(options_.abandoned)) return any;
    if (hopeful_[i] != 0) continue;
    std::optional<NoWay> proof;
    if (CanEver(service_, i, &surroundings_, &proof)) {
      hopeful_[i] = 1;
      continue;
    }
    Abandon(i, std::move(proof));
    any = true;
  }
  return any;
}

/// Changes the request after a failed attempt. Units with no way at all are given up at once.
/// Standing units may then be moved aside. Where none is left, the stuck unit goes in one way by
/// itself. Where that has failed too, a unit near it, or the stuck unit, is given up and stays.
void Planner::GiveWay() {
  if (AbandonHopeless()) return;
  bool added = false;
  for (const std::uint32_t i : stuck_) added = LetStepAside(i) || added;
  if (added) return;
  // Only one unit of each cluster changes at a time: after its change the others may find a way.
  std::vector<std::uint8_t> changed(scene_.size(), 0);
  for (const std::uint32_t i : stuck_) {
    const auto near = scene_.neighbours(i);
    const auto is_changed = [&](const NeighbourNeed& n) { return changed[n.unit] != 0; };
    if (changed[i] != 0 || std::any_of(near.begin(), near.end(), is_changed)) continue;
    const auto alone = std::find_if(
        near.begin(), near.end(), [&](const NeighbourNeed& n) { return by_itself_[n.unit] != 0; });
    const std::uint32_t which = by_itself_[i] != 0 || alone == near.end() ? i : alone->unit;
    changed[which] = 1;
    if (by_itself_[which] != 0 || service_.goal(which) == start_[which])
      Abandon(which);
    else
      by_itself_[which] = 1;
  }
}

Status Planner::CheckWanted() const {
  if (!IsAbandoned(options_.abandoned)) return {};
  return Fail(ErrorCode::kUnavailable, "nobody wants the plan any more");
}

double Planner::MeanNeighbours() const {
  std::size_t sum = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) sum += scene_.neighbours(i).size();
  return scene_.size() == 0 ? 0 : static_cast<double>(sum) / static_cast<double>(scene_.size());
}

/// Dense plates are searched by neighbourhoods, and so are others where units find no way around
/// each other or the plan ends late.
LocalSearchResult Planner::Search(LocalSearchRequest search) const {
  const DenseSearchOptions dense{.within = kDenseWithin, .improve_cpu_s = options_.improve_cpu_s};
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

/// Plans all units at once. False: some units still meet others, and nothing is planned.
bool Planner::AllAtOnce(std::span<const AxisPaths> begin_with) {
  std::vector<std::uint8_t> may_move(service_.movable().begin(), service_.movable().end());
  if (options_.fixed)
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (!request_.targets[i]) may_move[i] = 0;
  std::vector<AxisPaths> paths(begin_with.begin(), begin_with.end());
  std::uint64_t fresh_starts = 0;
  double slack = 0;  // of the time with limits of power; 0: not known yet
  for (int attempt = 0; attempt < kAttemptsMax && !IsAbandoned(options_.abandoned); ++attempt) {
    service_.DropCollidingTargets();
    scene_.AllowFor(start_);
    scene_.AllowFor(service_.goals());
    if (options_.lead_apart) scene_.LeadApartThroughout(start_);
    const Tolerance tolerance{options_.start_skew_s, options_.clock_error, options_.notice_s};
    std::optional<PowerLedger> ledger;
    double within_s = std::max({TimeBoundS(service_), plan_.makespan_s, options_.within_s});
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
    local_search_ = Search(search);
    if (local_search_.starved) break;
    if (local_search_.in_conflict.empty()) {
      PlanOfLocalSearch();
      return true;
    }
    // Some units may have no way at all: they stay, and the others are planned again.
    stuck_ = local_search_.in_conflict;
    std::erase_if(stuck_, [&](std::uint32_t i) { return !service_.is_movable(i); });
    if (AbandonHopeless()) continue;
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

void Planner::TracksOfPlan() {
  local_search_.tracks.clear();
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    local_search_.tracks.push_back(scene_.is_place(i) ? Track(scene_.arm(i), start_[i]) : Track());
  for (const UnitPlan& move : plan_.moves) {
    const std::uint32_t i = move.unit.value;
    local_search_.tracks[i] = Track(scene_.arm(i), request_.drives[i], move.from, move.path);
  }
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    for (const NeighbourNeed& near : scene_.neighbours(i))
      if (i < near.unit) local_search_.without_notice.emplace_back(i, near.unit);
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

/// Where the plan ends soon after the slowest unit alone, no pair is worth a look.
void Planner::FindBounds() {
  plan_.bound_s = TimeBoundS(service_);
  plan_.pair_bound_s = plan_.bound_s;
  plan_.pair_bound_by.reset();
  if (plan_.makespan_s <= kNearBound * plan_.bound_s) return;
  std::vector<double> end_s(scene_.size(), 0);
  for (const UnitPlan& move : plan_.moves)
    end_s[move.unit.value] = EndOf(move, request_.drives[move.unit.value]);
  const LargestPairBound largest = FindPairBound(service_, end_s, plan_.bound_s);
  plan_.pair_bound_s = largest.bound_s;
  plan_.pair_bound_by = largest.by;
}

Plan Planner::Finish() {
  const Tolerance proven{options_.start_skew_s, options_.clock_error, options_.notice_s};
  Tolerance plain = proven;
  plain.notice_s = 0;
  FindFollowers({.scene = &scene_,
                 .tracks = local_search_.tracks,
                 .tolerance = proven,
                 .without_notice = local_search_.without_notice,
                 .notice_s = options_.notice_s},
                &plan_);
  plan_.tightest = FindTightest(scene_, local_search_.tracks, plain, kTightest);
  plan_.too_near = too_near_;
  FindBounds();
  plan_.unserved = service_.NotServed();
  return std::move(plan_);
}

/// An order could not take account of given motions.
Result<Plan> Planner::AmongGiven() {
  if (options_.power.any()) FOCALFLEET_TRY(CheckPower(service_, options_));
  if (too_near_.empty() && AllAtOnce(request_.motions)) return Finish();
  FOCALFLEET_TRY(CheckWanted());
  std::string text = "no way was found among the motions that are given";
  for (const std::uint32_t i : stuck_) text += ", unit " + UnitName(layout_, i);
  return Fail(ErrorCode::kRefused, text);
}

Result<Plan> Planner::Run() {
  FOCALFLEET_TRY(Check());
  if (options_.lead_apart) too_near_ = service_.StartsTooNear();
  if (options_.leave_stuck) service_.DropTargetsThatMeet();
  if (!request_.given.empty()) return AmongGiven();
  if (options_.power.any()) FOCALFLEET_TRY(CheckPower(service_, options_));
  const bool at_once = !options_.stall_tolerant;
  // An order sends every unit through its cell, which costs a fleet that a camera corrects most of
  // its accuracy. A few units that stand too near must not lead to it.
  const Scene as_ruled = scene_;
  if (at_once && AllAtOnce(request_.motions)) return Finish();
  FOCALFLEET_TRY(CheckWanted());
  if (at_once && options_.leave_stuck && LeaveStuck()) return Finish();
  FOCALFLEET_TRY(CheckWanted());
  scene_ = as_ruled;
  std::vector<Piece> order;
  bool done = false;
  for (int attempt = 0; attempt < kAttemptsMax && !done; ++attempt) {
    service_.DropCollidingTargets();
    scene_.AllowFor(start_);
    scene_.AllowFor(service_.goals());
    if (options_.lead_apart) scene_.LeadApart(start_);
    done = Attempt(&order);
    FOCALFLEET_TRY(CheckWanted());
    if (!done) GiveWay();
  }
  if (!done) {
    order.clear();
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (service_.goes(i)) service_.Unserve(i, UnservedWhy::kBlocked, kNoUnitIndex);
  }
  // Stages gain nothing from short legs.
  const std::vector<Piece> pieces = options_.stall_tolerant ? order : CutPieces(order, scene_);
  std::optional<PowerLedger> ledger;
  if (options_.power.any())
    ledger.emplace(layout_, request_.drives, options_.motor, options_.power,
                   Tolerance{options_.start_skew_s, options_.clock_error, options_.notice_s});
  FOCALFLEET_TRY_ASSIGN(
      plan_, Schedule(pieces, scene_, request_.drives, options_, ledger ? &*ledger : nullptr));
  if (at_once && too_near_.empty() && (dense_ || !stuck_for_order_.empty())) ServeTheRest();
  if (local_search_.tracks.empty()) TracksOfPlan();
  return Finish();
}

}  // namespace

Status CheckPlanRequest(const PlanRequest& request, const PlanOptions& options) {
  FOCALFLEET_TRY(CheckShapes(request));
  if (options.within_s > kOffsetMaxS)
    return Fail(ErrorCode::kInvalid, "a start can be put off for " +
                                         std::to_string(static_cast<int>(kOffsetMaxS)) +
                                         " s at most: no plan can use more time");
  return Planner(request, options).Check();
}

Result<Plan> MakePlan(const PlanRequest& request, const PlanOptions& options) {
  FOCALFLEET_TRY(CheckShapes(request));
  // Stages are an order in time: a unit that moves at another time would leave them.
  if (options.stall_tolerant &&
      (options.objective != Objective::kSoonest || !request.given.empty()))
    return Fail(ErrorCode::kInvalid,
                "a plan in stages that unseen halts leave clear can neither have another objective "
                "nor go around given motions");
  if (options.objective == Objective::kSoonest) return Planner(request, options).Run();
  PlanOptions soonest = options;
  soonest.objective = Objective::kSoonest;
  soonest.within_s = 0;
  FOCALFLEET_TRY_ASSIGN(Plan plan, Planner(request, soonest).Run());
  return ImprovePlan(request, options, std::move(plan));
}

}  // namespace focalfleet
