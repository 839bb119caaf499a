#include "fleet/plan/planner.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "fleet/plan/bounds.h"
#include "fleet/plan/guarantee.h"
#include "fleet/plan/objective.h"
#include "fleet/plan/pair_bound.h"
#include "fleet/plan/planner_run.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/schedule.h"
#include "fleet/plan/service.h"

namespace focalfleet {
namespace {

constexpr std::size_t kTightest = 20;  // pairs that Plan::tightest lists
constexpr double kNearBound = 1.03;    // times the bound
/// With more neighbours than this on average a unit hardly ever finds all others out of its way:
/// many are planned anew together.
constexpr double kDenseNeighbours = 10;

std::vector<Pose> StartsOf(const PlanRequest& request) {
  std::vector<Pose> starts;
  starts.reserve(request.start.size());
  for (const UnitKnowledge& k : request.start) starts.push_back(IsPlace(k) ? PlaceOf(k) : Pose{});
  return starts;
}

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

}  // namespace

Planner::Planner(const PlanRequest& request, const PlanOptions& options)
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

double Planner::MeanNeighbours() const {
  std::size_t sum = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) sum += scene_.neighbours(i).size();
  return scene_.size() == 0 ? 0 : static_cast<double>(sum) / static_cast<double>(scene_.size());
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

Status Planner::CheckWanted() const {
  if (!IsAbandoned(options_.abandoned)) return {};
  return Fail(ErrorCode::kUnavailable, "nobody wants the plan any more");
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
