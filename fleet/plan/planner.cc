#include "fleet/plan/planner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <numbers>

#include "fleet/estimate.h"
#include "fleet/plan/choreography.h"
#include "fleet/plan/guarantee.h"
#include "fleet/plan/midway.h"
#include "fleet/plan/no_way.h"
#include "fleet/plan/objective.h"
#include "fleet/plan/retreat.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/schedule.h"

namespace focalfleet {
namespace {

/// Each attempt takes at least one unit out of the served ones or lets at least one step aside; a
/// fleet in which more goes wrong than this is planned with what can be served without any stepping
/// aside.
constexpr int kAttemptsMax = 60;
constexpr std::size_t kTightest = 20;
constexpr std::uint64_t kFreshStarts = 3;
constexpr double kLongGiven = 1.02;
constexpr double kFullShare = 0.75;
constexpr double kSlackMost = 2;  // times the bound that limits of power may take
/// With more neighbours than this a unit hardly ever finds everybody else out of its way: an order
/// is found sooner.
constexpr double kDenseNeighbours = 10;

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
        surroundings_(&scene_, start_) {}

  Result<Plan> Run();
  Status CheckOnly() {
    Classify();
    return Check();
  }

 private:
  Status Check();
  [[nodiscard]] bool IsGiven(std::uint32_t unit) const {
    return !request_.given.empty() && request_.given[unit] != 0;
  }
  void TakeGiven(std::uint32_t unit);
  Result<Plan> AmongGiven();
  void NameCollisions(std::span<const Pose> poses, std::span<const std::uint8_t> counts,
                      const char* what, std::string* text) const;
  void Classify();
  void Unserve(std::uint32_t unit, UnservedWhy why, std::uint32_t by);
  void DropTargetsThatMeet();
  void DropCollidingTargets();
  [[nodiscard]] bool CollidesWith(std::uint32_t unit, std::uint32_t* by) const;
  bool Attempt(std::vector<Piece>* order);
  void GiveWay();
  void Abandon(std::uint32_t unit);
  bool CanEver(std::uint32_t unit, std::optional<NoWay>* proof);
  [[nodiscard]] std::optional<NoWay> NoWayFor(std::uint32_t unit) const;
  bool AbandonHopeless();
  bool LetStepAside(std::uint32_t stuck);
  [[nodiscard]] std::uint32_t Blames(std::uint32_t unit) const;
  [[nodiscard]] Status CheckPower() const;
  [[nodiscard]] double MeanNeighbours() const;
  [[nodiscard]] double BoundS() const;
  double PowerBoundS(PowerLedger* ledger) const;
  bool AllAtOnce(std::span<const AxisPaths> begin_with);
  bool LeaveStuck();
  void PlanOfChoreography();
  void TracksOfPlan();
  void ServeTheRest();
  Plan Finish();

  const PlanRequest& request_;
  const PlanOptions& options_;
  const Layout& layout_;
  const std::vector<Pose> start_;  // of units without a place: meaningless
  Scene scene_;
  Surroundings surroundings_;
  std::vector<Pose> goal_;
  std::vector<std::uint8_t> movable_;
  std::vector<std::uint8_t> served_;
  std::vector<std::uint8_t> aside_;
  std::vector<std::uint8_t> by_itself_;  // goes from start to target in one way, not by its cell
  std::vector<std::uint8_t> hopeful_;    // CanEver was asked and said yes
  std::vector<std::uint8_t> movers_;
  std::vector<std::uint32_t> stuck_;
  std::vector<Unserved> unserved_;
  std::vector<std::uint32_t> stuck_for_order_;  // given up though a way exists
  Choreography choreography_;                   // tracks of plan_
  Plan plan_;
  double given_end_s_ = 0;  // of the last motion that is given
  std::string too_near_;    // pairs that start nearer than allowed, by name
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

std::string UnitName(const Layout& layout, std::uint32_t unit) {
  return std::to_string(layout.unit({unit}).id.value);
}

void Planner::Classify() {
  const std::size_t n = layout_.size();
  goal_ = start_;
  movable_.assign(n, 0);
  served_.assign(n, 0);
  aside_.assign(n, 0);
  by_itself_.assign(n, 0);
  hopeful_.assign(n, 0);
  for (std::uint32_t i = 0; i < n; ++i) {
    const bool enabled = layout_.unit({i}).enabled;
    const bool frozen = request_.frozen[i] != 0;
    const bool place = scene_.is_place(i);
    if (IsGiven(i) && place) {
      TakeGiven(i);
      continue;
    }
    movable_[i] = enabled && !frozen && place ? 1 : 0;
    if (!request_.targets[i]) continue;
    if (movable_[i] != 0) {
      served_[i] = 1;
      goal_[i] = *request_.targets[i];
    } else if (!enabled) {
      Unserve(i, UnservedWhy::kDisabled, kNobody);
    } else if (!place) {
      Unserve(i, UnservedWhy::kUnknownPlace, kNobody);
    } else if (*request_.targets[i] != start_[i]) {
      Unserve(i, UnservedWhy::kBlocked, i);
    }
  }
}

void Planner::TakeGiven(std::uint32_t unit) {
  const AxisPaths& motion = request_.motions[unit];
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : motion[k].segments()) {
      goal_[unit][k] += segment.delta;
      given_end_s_ = std::max(given_end_s_, TimeOf(segment, request_.drives[unit].axis[k]).t1_s);
    }
}

void Planner::Unserve(std::uint32_t unit, UnservedWhy why, std::uint32_t by) {
  served_[unit] = 0;
  goal_[unit] = start_[unit];
  Unserved unserved{{unit}, why, std::nullopt, std::nullopt};
  if (by != kNobody) unserved.by = PositionerIndex{by};
  unserved_.push_back(unserved);
}

void Planner::NameCollisions(std::span<const Pose> poses, std::span<const std::uint8_t> counts,
                             const char* what, std::string* text) const {
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (counts[i] == 0) continue;
    for (const NeighbourNeed& near : scene_.neighbours(i)) {
      if (near.unit < i || counts[near.unit] == 0) continue;
      const double distance =
          DistanceMm(scene_.arm(i).At(poses[i]), scene_.arm(near.unit).At(poses[near.unit]));
      const double need = scene_.FullNeed(i, near.unit);
      if (distance >= need - kClearToleranceMm) continue;
      std::array<char, 160> line{};
      std::snprintf(line.data(), line.size(),
                    "%s%s of units %s and %s are %.4f mm apart, %.4f mm needed",
                    text->empty() ? "" : "; ", what, UnitName(layout_, i).c_str(),
                    UnitName(layout_, near.unit).c_str(), distance, need);
      *text += line.data();
    }
  }
}

Status Planner::Check() {
  std::string text;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (served_[i] == 0 || scene_.arm(i).range().Contains(goal_[i])) continue;
    text += (text.empty() ? "the target of unit " : "; the target of unit ") +
            UnitName(layout_, i) + " is outside its axes' ranges";
  }
  NameCollisions(start_, movable_, "the starts", options_.lead_apart ? &too_near_ : &text);
  if (options_.leave_stuck)
    DropTargetsThatMeet();
  else
    NameCollisions(goal_, served_, "the targets", &text);
  if (!text.empty()) return Fail(ErrorCode::kInvalid, text);
  return {};
}

bool Planner::CollidesWith(std::uint32_t unit, std::uint32_t* by) const {
  const ArmGeometry& arm = scene_.arm(unit);
  const SegmentFp line = arm.At(goal_[unit]);
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    if (!scene_.is_place(near.unit) || served_[near.unit] != 0) continue;
    *by = near.unit;
    const double least = scene_.FullNeed(unit, near.unit) - kClearToleranceMm;
    if (DistanceMm(line, scene_.arm(near.unit).At(goal_[near.unit])) < least) return true;
  }
  for (const StandingThing& thing : scene_.standing(unit)) {
    if (thing.in_cell && scene_.InCell(unit, goal_[unit])) continue;
    *by = thing.by;
    if (DistanceMm(line, thing.capsule.line) < thing.capsule.radius_mm + thing.least_mm)
      return true;
  }
  return false;
}

/// Of two targets that would touch one stays where it stands, and the plan of the others stands.
void Planner::DropTargetsThatMeet() {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::uint32_t i = 0; i < scene_.size(); ++i) {
      for (const NeighbourNeed& near : scene_.neighbours(i)) {
        const std::uint32_t j = near.unit;
        if (served_[i] == 0 || served_[j] == 0 || goal_[i] == start_[i]) continue;
        const double least = scene_.FullNeed(i, j) - kClearToleranceMm;
        if (DistanceMm(scene_.arm(i).At(goal_[i]), scene_.arm(j).At(goal_[j])) >= least) continue;
        Unserve(i, UnservedWhy::kTargetCollides, j);
        changed = true;
      }
    }
  }
}

/// A target that would touch what stands is not served; its unit then stands too, so others may
/// follow.
void Planner::DropCollidingTargets() {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::uint32_t i = 0; i < scene_.size(); ++i) {
      std::uint32_t by = kNobody;
      if (served_[i] == 0 || goal_[i] == start_[i] || !CollidesWith(i, &by)) continue;
      Unserve(i, UnservedWhy::kTargetCollides, by);
      changed = true;
    }
  }
}

Piece BackOf(const Piece& piece) {
  return {piece.unit, {piece.sweep.to, piece.sweep.from, piece.sweep.out_of_step}};
}

/// One whole try: in, turn, out. False: stuck_ says who could not.
bool Planner::Attempt(std::vector<Piece>* order) {
  order->clear();
  stuck_.clear();
  movers_.assign(scene_.size(), 0);
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    movers_[i] = movable_[i] != 0 && (goal_[i] != start_[i] || aside_[i] != 0) ? 1 : 0;
  std::vector<std::uint8_t> by_cell = movers_;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (by_itself_[i] != 0) by_cell[i] = 0;
  Retreat in(&scene_, request_.drives, &surroundings_, start_, by_cell);
  in.Run();
  Retreat out(&scene_, request_.drives, &surroundings_, goal_, by_cell);
  out.Run();
  stuck_ = in.stuck();
  stuck_.insert(stuck_.end(), out.stuck().begin(), out.stuck().end());
  if (stuck_.empty()) {
    Midway turn(&scene_, request_.drives, &surroundings_, in.poses(), out.poses());
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

/// Who stands in the straight way of a stuck unit; kNobody where that cannot be told or is an
/// obstacle.
std::uint32_t Planner::Blames(std::uint32_t unit) const {
  const ArmGeometry& arm = scene_.arm(unit);
  const PhiSpan& cell = scene_.cell(unit);
  if (!scene_.HasCell(unit)) return kNobody;
  for (const std::vector<Pose>* poses : {&start_, &goal_}) {
    Pose end = (*poses)[unit];
    end[1] = std::clamp(end[1], cell.low, cell.high);
    const Sweep sweep{(*poses)[unit], end};
    for (const NeighbourNeed& near : scene_.neighbours(unit)) {
      if (!scene_.is_place(near.unit)) continue;
      const Capsule there{scene_.arm(near.unit).At((*poses)[near.unit]), 0};
      if (!SweepClearOf(arm, sweep, there, near.need_mm)) return near.unit;
    }
    for (const StandingThing& thing : scene_.standing(unit))
      if (!SweepClearOf(arm, sweep, thing.capsule, thing.need_mm)) return thing.by;
  }
  return kNobody;
}

bool Planner::LetStepAside(std::uint32_t stuck) {
  bool added = false;
  for (const NeighbourNeed& near : scene_.neighbours(stuck)) {
    const std::uint32_t j = near.unit;
    if (movable_[j] == 0 || movers_[j] != 0 || aside_[j] != 0 || !scene_.HasCell(j)) continue;
    if (options_.fixed && !request_.targets[j]) continue;
    aside_[j] = 1;
    added = true;
  }
  return added;
}

void Planner::Abandon(std::uint32_t unit) {
  if (served_[unit] != 0 && goal_[unit] != start_[unit]) {
    if (hopeful_[unit] != 0) stuck_for_order_.push_back(unit);
    Unserve(unit, UnservedWhy::kBlocked, Blames(unit));
  } else
    movable_[unit] = 0;
  aside_[unit] = 0;
  by_itself_[unit] = 0;
}

/// Whether a way may lead from the start to the target if all that can move were away. False: there
/// is none that a search finds; `proof` (where that is possible): there is none at all.
bool Planner::CanEver(std::uint32_t unit, std::optional<NoWay>* proof) {
  proof->reset();
  if (goal_[unit] == start_[unit]) return true;
  std::vector<std::uint8_t> immovable(scene_.size());
  for (const NeighbourNeed& near : scene_.neighbours(unit))
    immovable[near.unit] = movable_[near.unit] == 0 && !IsGiven(near.unit) ? 1 : 0;
  PathSearch::Question question;
  question.arm = &scene_.arm(unit);
  question.drive = &request_.drives[unit];
  question.blockers = surroundings_.AroundOf(unit, immovable);
  question.from = start_[unit];
  question.within = RangeAround(*question.arm, question.from);
  question.goal = PoseBox::Of(goal_[unit]);
  for (const double grid_deg : kSearchGridsDeg) {
    question.grid_deg = grid_deg;
    if (!surroundings_.search().Find(question).empty()) return true;
  }
  *proof = NoWayFor(unit);
  return false;
}

/// A proof that whatever never moves leaves the unit no way to this pose. Covers of uncertain units
/// are wider than these may be, so next to one there is none.
std::optional<NoWay> Planner::NoWayFor(std::uint32_t unit) const {
  std::vector<Blocker> never_move;
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    const std::uint32_t j = near.unit;
    if (!scene_.is_place(j)) continue;
    if (layout_.unit({j}).enabled && request_.frozen[j] == 0) continue;
    const double least_mm = std::min(scene_.FullNeed(unit, j) - kClearToleranceMm, near.need_mm);
    never_move.push_back({{scene_.arm(j).At(start_[j]), 0}, least_mm, j});
  }
  for (const StandingThing& thing : scene_.standing(unit)) {
    if (thing.by != kNobody) continue;
    never_move.push_back({thing.capsule, thing.least_mm, thing.by});
  }
  return ProveNoWay({.arm = &scene_.arm(unit),
                     .never_move = never_move,
                     .from = start_[unit],
                     .to = goal_[unit]});
}

/// Gives up on stuck units that no order of moves can help. True: there was one.
bool Planner::AbandonHopeless() {
  bool any = false;
  for (const std::uint32_t i : stuck_) {
    if (hopeful_[i] != 0) continue;
    std::optional<NoWay> proof;
    if (CanEver(i, &proof)) {
      hopeful_[i] = 1;
      continue;
    }
    Abandon(i);
    if (proof) unserved_.back().proof = std::move(proof);
    any = true;
  }
  return any;
}

/// After a failed attempt. What is hopeless is given up at once. Those that stand may step aside;
/// where nobody is left to ask, the stuck unit tries it by itself; where that has been tried, near
/// it or by itself, that unit is given up and stays.
void Planner::GiveWay() {
  if (AbandonHopeless()) return;
  bool added = false;
  for (const std::uint32_t i : stuck_) added = LetStepAside(i) || added;
  if (added) return;
  // One of each cluster at a time: with it changed the others may find a way.
  std::vector<std::uint8_t> changed(scene_.size(), 0);
  for (const std::uint32_t i : stuck_) {
    const auto near = scene_.neighbours(i);
    const auto is_changed = [&](const NeighbourNeed& n) { return changed[n.unit] != 0; };
    if (changed[i] != 0 || std::any_of(near.begin(), near.end(), is_changed)) continue;
    const auto alone = std::find_if(
        near.begin(), near.end(), [&](const NeighbourNeed& n) { return by_itself_[n.unit] != 0; });
    const std::uint32_t which = by_itself_[i] != 0 || alone == near.end() ? i : alone->unit;
    changed[which] = 1;
    if (by_itself_[which] != 0 || goal_[which] == start_[which])
      Abandon(which);
    else
      by_itself_[which] = 1;
  }
}

/// A limit below what one motor draws lets nobody move; one that takes longer than offsets can say
/// leaves some no time.
Status Planner::CheckPower() const {
  PowerLedger ledger(layout_, request_.drives, options_.motor, options_.power, {});
  double least_W = 0;  // of those that go somewhere
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      if (served_[i] != 0 && goal_[i][k] != start_[i][k])
        least_W = std::max(least_W, ledger.Motor_W(i, k));
  std::array<char, 160> text{};
  for (const auto& [limit_W, name] :
       {std::pair{options_.power.rail_W, "rail"}, std::pair{options_.power.total_W, "total"}}) {
    if (limit_W <= 0 || limit_W >= least_W) continue;
    std::snprintf(text.data(), text.size(),
                  "the %s limit of %.4f W is below what one motor draws; at least %.4f W "
                  "are needed",
                  name, limit_W, least_W);
    return Fail(ErrorCode::kRefused, text.data());
  }
  const double least_s = PowerBoundS(&ledger);
  if (least_s <= kOffsetMaxS) return {};
  std::snprintf(text.data(), text.size(),
                "the limits of power need %.0f s at least, a start can be put off for %.0f s; "
                "limits must be at least %.3f times as high",
                least_s, kOffsetMaxS, least_s / kOffsetMaxS);
  return Fail(ErrorCode::kRefused, text.data());
}

double Planner::MeanNeighbours() const {
  std::size_t sum = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) sum += scene_.neighbours(i).size();
  return scene_.size() == 0 ? 0 : static_cast<double>(sum) / static_cast<double>(scene_.size());
}

double Planner::BoundS() const {
  double bound_s = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (served_[i] != 0)
      bound_s = std::max(bound_s, Straight(request_.drives[i], start_[i], goal_[i]).end_s);
  return bound_s;
}

/// With limits of power no plan is shorter than the energy of straight moves over the limit.
double Planner::PowerBoundS(PowerLedger* ledger) const {
  std::map<std::uint32_t, double> rails;
  double total_J = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (served_[i] == 0) continue;
    const double energy_J =
        ledger->Energy(i, Straight(request_.drives[i], start_[i], goal_[i]).path);
    rails[layout_.unit({i}).rail.value] += energy_J;
    total_J += energy_J;
  }
  double bound_s = options_.power.total_W > 0 ? total_J / options_.power.total_W : 0;
  if (options_.power.rail_W > 0)
    for (const auto& [rail, energy_J] : rails)
      bound_s = std::max(bound_s, energy_J / options_.power.rail_W);
  return bound_s;
}

/// Everybody at once. False: somebody is left who meets others; nothing is planned then.
bool Planner::AllAtOnce(std::span<const AxisPaths> begin_with) {
  std::vector<std::uint8_t> may_move = movable_;
  if (options_.fixed)
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (!request_.targets[i]) may_move[i] = 0;
  std::vector<AxisPaths> paths(begin_with.begin(), begin_with.end());
  std::uint64_t fresh_starts = 0;
  double slack = 0;  // of the time with limits of power; 0: not known yet
  for (int attempt = 0; attempt < kAttemptsMax; ++attempt) {
    DropCollidingTargets();
    scene_.AllowFor(start_);
    scene_.AllowFor(goal_);
    if (options_.lead_apart) scene_.LeadApartThroughout(start_);
    const Tolerance tolerance{options_.start_skew_s, options_.clock_error, options_.notice_s};
    std::optional<PowerLedger> ledger;
    double within_s = std::max({BoundS(), plan_.makespan_s, options_.within_s});
    // Each turn of sectors may take a little longer than its bound: that must not add up.
    if (given_end_s_ > kLongGiven * within_s) within_s = given_end_s_;
    if (options_.power.any()) {
      ledger.emplace(layout_, request_.drives, options_.motor, options_.power, tolerance);
      // Where power is what takes the time, rails that are full leave no room to give way.
      const double power_s = PowerBoundS(&*ledger);
      if (slack == 0) slack = power_s > kFullShare * within_s ? 1.3 : 1.02;
      within_s = std::min(std::max(within_s, power_s) * slack, kOffsetMaxS);
    }
    choreography_ = Choreograph({.scene = &scene_,
                                 .drives = request_.drives,
                                 .from = start_,
                                 .to = goal_,
                                 .movable = may_move,
                                 .begin_with = paths,
                                 .given = request_.given,
                                 .ledger = ledger ? &*ledger : nullptr,
                                 .tolerance = tolerance,
                                 .within_s = within_s,
                                 .seed = options_.seed + fresh_starts});
    if (choreography_.starved) break;
    if (choreography_.in_conflict.empty()) {
      PlanOfChoreography();
      return true;
    }
    // Some may have no way at all: they stay, and the others are asked again.
    stuck_ = choreography_.in_conflict;
    std::erase_if(stuck_, [&](std::uint32_t i) { return movable_[i] == 0; });
    if (AbandonHopeless()) continue;
    // The others may need more time within limits of power, or other luck.
    if (ledger) slack *= 1.1;
    if (ledger ? slack > kSlackMost : ++fresh_starts > kFreshStarts) break;
    if (!options_.power.any()) paths = choreography_.paths;
  }
  choreography_ = {};
  return false;
}

/// After all at once has failed: once more, without those that it failed for. False: they are too
/// many, or do not move; nothing has changed then.
bool Planner::LeaveStuck() {
  constexpr int kTimes = 8;
  const std::vector<Unserved> unserved = unserved_;
  const std::vector<std::uint8_t> served = served_;
  const std::vector<std::uint8_t> movable = movable_;
  const std::vector<Pose> goal = goal_;
  for (int time = 0; time < kTimes && !stuck_.empty(); ++time) {
    // One of each cluster at a time: with it at rest the others may find a way.
    std::vector<std::uint8_t> stays(scene_.size(), 0);
    for (const std::uint32_t i : stuck_) {
      const auto near = scene_.neighbours(i);
      const auto is_at_rest = [&](const NeighbourNeed& n) { return stays[n.unit] != 0; };
      if (std::any_of(near.begin(), near.end(), is_at_rest)) continue;
      stays[i] = 1;
      if (served_[i] != 0 && goal_[i] != start_[i]) Unserve(i, UnservedWhy::kBlocked, Blames(i));
      movable_[i] = 0;
    }
    stuck_.clear();
    if (AllAtOnce(request_.motions)) return true;
  }
  unserved_ = unserved;
  served_ = served;
  movable_ = movable;
  goal_ = goal;
  return false;
}

void Planner::PlanOfChoreography() {
  plan_ = {};
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    const AxisPaths& paths = choreography_.paths[i];
    if (paths[0].size() + paths[1].size() == 0) continue;
    UnitPlan unit{.unit = {i},
                  .from = start_[i],
                  .to = goal_[i],
                  .mode = request_.drives[i].mode,
                  .path = paths,
                  .followers = {}};
    plan_.makespan_s = std::max(plan_.makespan_s, EndOf(unit, request_.drives[i]));
    plan_.moves.push_back(std::move(unit));
  }
}

void Planner::TracksOfPlan() {
  choreography_.tracks.clear();
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    choreography_.tracks.push_back(scene_.is_place(i) ? Track(scene_.arm(i), start_[i]) : Track());
  for (const UnitPlan& move : plan_.moves) {
    const std::uint32_t i = move.unit.value;
    choreography_.tracks[i] = Track(scene_.arm(i), request_.drives[i], move.from, move.path);
  }
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    for (const NeighbourNeed& near : scene_.neighbours(i))
      if (i < near.unit) choreography_.without_notice.emplace_back(i, near.unit);
}

/// Those that found no turn in the order go among the others as these are planned.
void Planner::ServeTheRest() {
  const std::vector<Unserved> unserved = unserved_;
  const std::vector<std::uint8_t> served = served_;
  const std::vector<Pose> goal = goal_;
  const Plan ordered = plan_;
  std::vector<AxisPaths> paths(scene_.size());
  for (const UnitPlan& move : plan_.moves) paths[move.unit.value] = move.path;
  for (const std::uint32_t i : stuck_for_order_) {
    movable_[i] = served_[i] = 1;
    goal_[i] = *request_.targets[i];
    std::erase_if(unserved_, [i](const Unserved& u) { return u.unit.value == i; });
  }
  if (AllAtOnce(paths)) return;
  served_ = served;
  goal_ = goal;
  unserved_ = unserved;
  plan_ = ordered;
}

Plan Planner::Finish() {
  const Tolerance proven{options_.start_skew_s, options_.clock_error, options_.notice_s};
  Tolerance plain = proven;
  plain.notice_s = 0;
  FindFollowers({.scene = &scene_,
                 .tracks = choreography_.tracks,
                 .tolerance = proven,
                 .without_notice = choreography_.without_notice,
                 .notice_s = options_.notice_s},
                &plan_);
  plan_.tightest = FindTightest(scene_, choreography_.tracks, plain, kTightest);
  plan_.too_near = too_near_;
  plan_.bound_s = BoundS();
  std::sort(unserved_.begin(), unserved_.end(),
            [](const Unserved& a, const Unserved& b) { return a.unit < b.unit; });
  plan_.unserved = std::move(unserved_);
  return std::move(plan_);
}

/// An order would not know what is given.
Result<Plan> Planner::AmongGiven() {
  if (options_.power.any()) FOCALFLEET_TRY(CheckPower());
  if (too_near_.empty() && AllAtOnce(request_.motions)) return Finish();
  std::string text = "no way was found among the motions that are given";
  for (const std::uint32_t i : stuck_) text += ", unit " + UnitName(layout_, i);
  return Fail(ErrorCode::kRefused, text);
}

Result<Plan> Planner::Run() {
  Classify();
  FOCALFLEET_TRY(Check());
  if (!request_.given.empty()) return AmongGiven();
  if (options_.power.any()) FOCALFLEET_TRY(CheckPower());
  const bool dense = MeanNeighbours() > kDenseNeighbours;
  const bool at_once = !dense && !options_.stall_tolerant;
  // An order sends everybody through its cell, which costs a fleet that a camera corrects most of
  // its accuracy: that a few stand too near must not lead to it.
  const Scene as_ruled = scene_;
  if (at_once && AllAtOnce(request_.motions)) return Finish();
  if (at_once && options_.leave_stuck && LeaveStuck()) return Finish();
  scene_ = as_ruled;
  std::vector<Piece> order;
  bool done = false;
  for (int attempt = 0; attempt < kAttemptsMax && !done; ++attempt) {
    DropCollidingTargets();
    scene_.AllowFor(start_);
    scene_.AllowFor(goal_);
    if (options_.lead_apart) scene_.LeadApart(start_);
    done = Attempt(&order);
    if (!done) GiveWay();
  }
  if (!done) {
    order.clear();
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (served_[i] != 0 && goal_[i] != start_[i]) Unserve(i, UnservedWhy::kBlocked, kNobody);
  }
  // Stages gain nothing from short legs.
  const std::vector<Piece> pieces = options_.stall_tolerant ? order : CutPieces(order, scene_);
  std::optional<PowerLedger> ledger;
  if (options_.power.any())
    ledger.emplace(layout_, request_.drives, options_.motor, options_.power,
                   Tolerance{options_.start_skew_s, options_.clock_error, options_.notice_s});
  FOCALFLEET_TRY_ASSIGN(
      plan_, Schedule(pieces, scene_, request_.drives, options_, ledger ? &*ledger : nullptr));
  if (at_once && too_near_.empty() && !stuck_for_order_.empty()) ServeTheRest();
  if (choreography_.tracks.empty()) TracksOfPlan();
  return Finish();
}

}  // namespace

Status CheckPlanRequest(const PlanRequest& request, const PlanOptions& options) {
  FOCALFLEET_TRY(CheckShapes(request));
  if (options.within_s > kOffsetMaxS)
    return Fail(ErrorCode::kInvalid, "a start can be put off for " +
                                         std::to_string(static_cast<int>(kOffsetMaxS)) +
                                         " s at most: no plan can use more time");
  return Planner(request, options).CheckOnly();
}

Result<Plan> MakePlan(const PlanRequest& request, const PlanOptions& options) {
  FOCALFLEET_TRY(CheckShapes(request));
  // Stages are an order in time: whoever goes at another time would leave them.
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
