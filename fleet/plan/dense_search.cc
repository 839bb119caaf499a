#include "fleet/plan/dense_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "fleet/plan/joint_search.h"
#include "fleet/plan/motions.h"
#include "fleet/plan/pair_search.h"
#include "fleet/plan/soft_search.h"
#include "fleet/plan/step_questions.h"
#include "fleet/plan/unit_ways.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

constexpr std::size_t kChosenMost = 8;  // units that are planned anew together
constexpr int kUnitsPerRepair = 2;      // of the first plan, until more time is allowed
constexpr int kRepairsAtLeast = 100;
constexpr std::int32_t kExtendBy = 6;  // the time grows by this part of it
constexpr int kTriesWithMostTime = 3;
/// More conflicts than one for so many units, which hardly get fewer: no end is in sight.
constexpr std::size_t kHopelessShare = 10;
constexpr std::size_t kHopelessAtLeast = 4;
constexpr int kRepairsPerCut = 120;
/// A cut is at least this share of the time that is above the bound; each failure halves it.
constexpr double kCutShare = 0.4;
constexpr int kFailuresMost = 16;       // in a row, of the smallest cut
constexpr double kGoodEnough = 1.005;   // times the bound: nothing is left to gain
constexpr int kRepairsWithNotice = 12;  // then a pair need not be clear with notice
/// A pair that fails so often weighs one conflict more (breakout local search, Morris 1993).
constexpr int kFailuresPerWeight = 6;
constexpr int kFailuresUntilThorough = 3;
/// Cost of work, in seconds of CPU.
constexpr double kWordCost_s = 2e-9;
constexpr double kReplanCost_s = 350e-6;
constexpr double kJointStepCost_s = 0.8e-6;

/// The motion of a unit before it was planned anew.
struct Before {
  std::uint32_t unit = 0;
  AxisPaths path;
};

bool IsAmong(std::span<const Before> units, std::uint32_t unit) {
  return std::any_of(units.begin(), units.end(),
                     [&](const Before& before) { return before.unit == unit; });
}

class DenseSearch {
 public:
  DenseSearch(const LocalSearchRequest& request, const DenseSearchOptions& options)
      : q_(request),
        options_(options),
        scene_(*request.scene),
        rng_(Rng::Stream(request.seed, "dense")),
        motions_(request),
        ways_(&motions_, &rng_),
        is_between_(scene_.size(), 0),
        questions_(&motions_),
        end_step_(std::min(questions_.steps().count - 1,
                           static_cast<std::int32_t>(std::ceil(options.within * request.within_s /
                                                               questions_.steps().step_s())) +
                               1)) {}

  LocalSearchResult Run();

 private:
  using Pair = std::pair<std::uint32_t, std::uint32_t>;
  void Begin();
  bool MayPlan(std::uint32_t unit) const {
    return q_.movable[unit] != 0 && !motions_.IsGiven(unit) && scene_.is_place(unit);
  }
  bool Replan(std::uint32_t unit);
  bool ReplanBetween(std::uint32_t unit);
  bool ReplanTogether(std::span<const std::uint32_t> units, bool thoroughly);
  bool Take(std::span<const std::uint32_t> units, std::span<const AxisPaths> paths);
  void Set(std::uint32_t unit, const AxisPaths& path) {
    motions_.Replace(unit, path);
    questions_.Forget(unit);
  }
  void TakeOut(std::uint32_t unit) {
    motions_.TakeOut(unit);
    questions_.Forget(unit);
  }
  bool Choose(std::uint32_t unit);
  void ChooseMet(std::size_t first, std::size_t last);
  void PutBack(std::span<const Before> before);
  void UpdateConflicts(std::uint32_t unit);
  [[nodiscard]] int WeightOf(const Pair& pair) const {
    const auto it = failures_.find(pair);
    return 1 + (it == failures_.end() ? 0 : it->second / kFailuresPerWeight);
  }
  [[nodiscard]] int ConflictsOfChosen();
  bool Repair(const Pair& pair);
  bool PlanChosen(std::size_t planned, bool ok);
  bool RepairAll(int repairs_most);
  void Improve();
  bool CompleteFirst();
  bool CutTo(std::int32_t end_step);
  [[nodiscard]] double EndOfUnit(std::uint32_t unit) const {
    return MayPlan(unit) && !IsEmpty(motions_.path(unit)) ? motions_.track(unit).end_s() : 0;
  }
  /// The first plan may use its work up; cuts of the time have a limit of their own.
  [[nodiscard]] bool MayGoOn() const {
    return !IsAbandoned(q_.abandoned) && (in_cut_ || Work_s() < options_.complete_cpu_s);
  }
  [[nodiscard]] double Work_s() const {
    return static_cast<double>(search_.work() + pair_search_.work()) * kWordCost_s +
           static_cast<double>(replans_) * kReplanCost_s +
           static_cast<double>(joint_.work()) * kJointStepCost_s;
  }

  const LocalSearchRequest& q_;
  const DenseSearchOptions& options_;
  const Scene& scene_;
  Rng rng_;
  Motions motions_;
  UnitWays ways_;
  std::vector<std::uint8_t> is_between_;  // goes where the grid has no way
  StepQuestions questions_;
  SoftSearch search_;
  JointSearch joint_;
  PairSearch pair_search_;
  std::int32_t end_step_ = 0;
  std::set<Pair> conflicts_;
  std::map<Pair, int> failures_;    // repairs of a pair that did not stay
  std::vector<Before> chosen_;      // taken out, or planned anew already
  std::vector<Before> before_cut_;  // of units that were planned anew since the time was cut
  bool in_cut_ = false;
  std::uint64_t replans_ = 0;
};

void DenseSearch::UpdateConflicts(std::uint32_t unit) {
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot) {
    const Pair pair = std::minmax(unit, scene_.neighbours(unit)[slot].unit);
    // A unit may be without a way: limits of power, or nobody wants the plan any more.
    const bool has_way = !motions_.track(unit).legs().empty();
    if (has_way && motions_.Meet(unit, slot))
      conflicts_.insert(pair);
    else
      conflicts_.erase(pair);
  }
}

/// Pre: the unit is taken out.
bool DenseSearch::Replan(std::uint32_t unit) {
  ++replans_;
  questions_.FindRests({&unit, 1}, end_step_);
  const auto found = search_.Find(questions_.Ask(unit, 0, end_step_));
  if (found && motions_.KeepsLimits(unit, found->paths)) {
    Set(unit, found->paths);
    if (!MeetsForGood(unit, &motions_)) return true;
    TakeOut(unit);
  }
  if (in_cut_ && is_between_[unit] == 0) return false;
  if (!ReplanBetween(unit)) return false;
  is_between_[unit] = 1;
  return true;
}

/// A way between things that never move may be too narrow for the grid, and a full rail may have no
/// room for the grid's way. Pre: the unit is taken out.
bool DenseSearch::ReplanBetween(std::uint32_t unit) {
  const auto near = scene_.neighbours(unit);
  if (q_.ledger == nullptr && scene_.standing(unit).empty() &&
      std::ranges::all_of(near, [&](const NeighbourNeed& n) { return q_.movable[n.unit] != 0; }))
    return false;
  const double within_s = end_step_ * questions_.steps().step_s();
  std::vector<Candidate> found = ways_.ViaCell(unit, kNoUnitIndex, within_s);
  AppendAlong(
      ways_.QuestionFor(unit, within_s),
      ways_.AmongStanding(unit, q_.from[unit], PoseBox::Of(q_.to[unit]), kNoUnitIndex, q_.from),
      &found);
  std::size_t chosen = 0;
  if (ways_.Cheapest(unit, within_s, found, 0, &chosen) == Motions::kNever) return false;
  Set(unit, found[chosen].path);
  return !MeetsForGood(unit, &motions_);
}

/// Pre: the units are taken out; all are neighbours of each other.
bool DenseSearch::ReplanTogether(std::span<const std::uint32_t> units, bool thoroughly) {
  questions_.FindRests(units, end_step_);
  if (thoroughly && units.size() == 2) {
    const auto found = pair_search_.Find(
        {.units = {questions_.Ask(units[0], 0, end_step_), questions_.Ask(units[1], 1, end_step_)},
         .need_mm = questions_.NeedOf(units[0], units[1])});
    if (found && Take(units, found->paths)) return true;
    for (const std::uint32_t i : units) TakeOut(i);
  }
  JointSearch::Question question;
  question.steps = questions_.steps();
  question.end_step = end_step_;
  std::array<JointSearch::Member, JointSearch::kMembersMax> members;
  for (std::size_t m = 0; m < units.size(); ++m) {
    const std::uint32_t i = units[m];
    const StepQuestion alone = questions_.Ask(i, m, end_step_);
    members[m] = {.arm = alone.arm,
                  .drive = alone.drive,
                  .around = alone.around,
                  .standing = alone.standing,
                  .from = alone.from,
                  .to = alone.to,
                  .within = alone.within};
    for (std::size_t other = 0; other < m; ++other)
      question.need_mm[other][m] = questions_.NeedOf(units[other], i);
  }
  question.members = std::span(members).first(units.size());
  question.rests = questions_.rests();
  const auto found = joint_.Find(question, &rng_);
  return found && Take(units, found->paths);
}

/// The units take these ways. False: one breaks a limit of power, or meets what never moves.
bool DenseSearch::Take(std::span<const std::uint32_t> units, std::span<const AxisPaths> paths) {
  for (std::size_t m = 0; m < units.size(); ++m) {
    if (!motions_.KeepsLimits(units[m], paths[m])) return false;
    Set(units[m], paths[m]);
    if (MeetsForGood(units[m], &motions_)) return false;
  }
  // The members keep to one clock: they are clear of each other, but perhaps not with notice.
  for (std::size_t m = 0; m < units.size(); ++m)
    for (std::size_t other = 0; other < m; ++other)
      if (const std::uint32_t slot = motions_.SlotOf(units[m], units[other]);
          motions_.Meet(units[m], slot))
        motions_.GiveUpNotice(units[m], slot);
  return true;
}

/// The longest way first: it has the least room to give way.
void DenseSearch::Begin() {
  std::vector<std::pair<double, std::uint32_t>> order;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (!scene_.is_place(i)) continue;
    const bool begun = !q_.begin_with.empty() && Reaches(q_, i, q_.begin_with[i]);
    if (motions_.IsGiven(i))
      motions_.Begin(i, q_.begin_with[i]);
    else if (q_.movable[i] == 0)
      motions_.BeginStanding(i);
    else if (begun && motions_.KeepsLimits(i, q_.begin_with[i]))
      Set(i, q_.begin_with[i]);
    else
      order.emplace_back(-Straight(q_.drives[i], q_.from[i], q_.to[i]).end_s, i);
  }
  std::sort(order.begin(), order.end());
  // Where a unit still has no way of its own, others expect it on its straight one.
  for (const auto& [end, i] : order) {
    const AxisPaths straight = Straight(q_.drives[i], q_.from[i], q_.to[i]).path;
    if (motions_.KeepsLimits(i, straight)) Set(i, straight);
  }
  for (const auto& [end, i] : order) {
    if (IsAbandoned(q_.abandoned)) break;
    const AxisPaths straight = motions_.path(i);
    TakeOut(i);
    if (!Replan(i)) Set(i, straight);
  }
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (!MayPlan(i)) continue;
    UpdateConflicts(i);
    end_step_ = std::max(
        end_step_,
        static_cast<std::int32_t>(std::ceil(EndOfUnit(i) / questions_.steps().step_s() - 1e-6)));
  }
  if (q_.begin_with.empty()) return;
  // An order has no notice to keep.
  const std::set<Pair> met = conflicts_;
  for (const auto& [a, b] : met) {
    motions_.GiveUpNotice(a, motions_.SlotOf(a, b));
    UpdateConflicts(a);
  }
}

bool DenseSearch::Choose(std::uint32_t unit) {
  if (!MayPlan(unit) || IsAmong(chosen_, unit)) return false;
  chosen_.push_back({unit, motions_.path(unit)});
  if (in_cut_ && !IsAmong(before_cut_, unit)) before_cut_.push_back(chosen_.back());
  TakeOut(unit);
  return true;
}

/// Chooses the units that these chosen ones meet.
void DenseSearch::ChooseMet(std::size_t first, std::size_t last) {
  for (std::size_t n = first; n < last; ++n) {
    const std::uint32_t i = chosen_[n].unit;
    for (std::uint32_t slot = 0; slot < scene_.neighbours(i).size(); ++slot) {
      if (chosen_.size() >= kChosenMost) return;
      if (motions_.Meet(i, slot)) Choose(scene_.neighbours(i)[slot].unit);
    }
  }
}

void DenseSearch::PutBack(std::span<const Before> before) {
  // The limits of power may hold only once all are out.
  for (const Before& b : before) TakeOut(b.unit);
  for (const Before& b : before) Set(b.unit, b.path);
}

/// The sum of the weights of the conflicts that chosen units have now.
int DenseSearch::ConflictsOfChosen() {
  int weight = 0;
  for (const Before& b : chosen_) {
    for (std::uint32_t slot = 0; slot < scene_.neighbours(b.unit).size(); ++slot) {
      const std::uint32_t other = scene_.neighbours(b.unit)[slot].unit;
      if (IsAmong(chosen_, other) && other < b.unit) continue;
      if (motions_.Meet(b.unit, slot)) weight += WeightOf(std::minmax(b.unit, other));
    }
  }
  return weight;
}

/// Plans the chosen units from `planned` on, and those that they meet. False: one has no way.
bool DenseSearch::PlanChosen(std::size_t planned, bool ok) {
  std::size_t looked = 0;
  while (ok) {
    ChooseMet(looked, planned);
    looked = planned;
    if (planned == chosen_.size()) break;
    std::swap(chosen_[planned], chosen_[planned + rng_.Below(chosen_.size() - planned)]);
    ok = Replan(chosen_[planned++].unit);
  }
  return ok;
}

/// Plans two units in conflict anew, and those that they meet then. True: the conflicts weigh no
/// more than before, and the change stays.
bool DenseSearch::Repair(const Pair& pair) {
  chosen_.clear();
  Choose(pair.first);
  Choose(pair.second);
  if (chosen_.empty()) return false;
  bool ok = true;
  std::size_t planned = chosen_.size();
  if (planned == 2 && rng_.Below(3) != 0) {
    // Sometimes a third unit stands between the two.
    const auto near = scene_.neighbours(pair.first);
    const std::uint32_t third = near[rng_.Below(near.size())].unit;
    if (rng_.Below(4) == 0 && motions_.SlotOf(third, pair.second) < scene_.neighbours(third).size())
      planned += Choose(third) ? 1u : 0u;
    std::array<std::uint32_t, JointSearch::kMembersMax> units{};
    for (std::size_t n = 0; n < planned; ++n) units[n] = chosen_[n].unit;
    // Trees are quick and often find a way; where they have failed, all ways are looked at.
    const auto failed = failures_.find(pair);
    const bool thoroughly = failed != failures_.end() && failed->second >= kFailuresUntilThorough;
    ok = ReplanTogether(std::span(units).first(planned), thoroughly);
  } else {
    if (planned == 2 && rng_.Below(2) == 0) std::swap(chosen_[0], chosen_[1]);
    ok = Replan(chosen_[0].unit);
    planned = 1;
    const std::size_t extra = rng_.Below(3);
    for (std::size_t n = 0; n < extra; ++n) {
      const auto near = scene_.neighbours(chosen_[rng_.Below(chosen_.size())].unit);
      Choose(near[rng_.Below(near.size())].unit);
    }
  }
  ok = PlanChosen(planned, ok);
  if (ok) {
    int before = 0;
    for (const Pair& p : conflicts_)
      if (IsAmong(chosen_, p.first) || IsAmong(chosen_, p.second)) before += WeightOf(p);
    ok = ConflictsOfChosen() <= before;
  }
  if (!ok) {
    ++failures_[pair];
    PutBack(chosen_);
    return false;
  }
  for (const Before& b : chosen_) UpdateConflicts(b.unit);
  return true;
}

/// True: no conflict is left.
bool DenseSearch::RepairAll(int repairs_most) {
  for (int n = 0; n < repairs_most && !conflicts_.empty() && MayGoOn(); ++n) {
    auto it = conflicts_.begin();
    std::advance(it, static_cast<std::ptrdiff_t>(rng_.Below(conflicts_.size())));
    const Pair pair = *it;
    Repair(pair);
    if (n % kRepairsWithNotice == kRepairsWithNotice - 1 && conflicts_.contains(pair)) {
      motions_.GiveUpNotice(pair.first, motions_.SlotOf(pair.first, pair.second));
      UpdateConflicts(pair.first);
    }
  }
  return conflicts_.empty();
}

/// Where repairs take long more time is allowed, up to the end of the steps.
bool DenseSearch::CompleteFirst() {
  const int repairs = std::max(kRepairsAtLeast, static_cast<int>(scene_.size()) / kUnitsPerRepair);
  const std::int32_t most = questions_.steps().count - 1;
  for (int tries = 0; tries < kTriesWithMostTime; tries += end_step_ == most ? 1 : 0) {
    const std::size_t before = conflicts_.size();
    if (RepairAll(repairs)) return true;
    if (!MayGoOn()) return false;
    // Units without any way keep many others in conflict.
    if (conflicts_.size() > std::max(kHopelessAtLeast, scene_.size() / kHopelessShare) &&
        10 * conflicts_.size() > 9 * before)
      return false;
    end_step_ = std::min(most, end_step_ + std::max(1, end_step_ / kExtendBy));
  }
  return conflicts_.empty();
}

/// All units end before this step. False: no such plan was found, and all move as before.
bool DenseSearch::CutTo(std::int32_t end_step) {
  const std::int32_t end_before = end_step_;
  end_step_ = end_step;
  in_cut_ = true;
  before_cut_.clear();
  const double end_s = (end_step + 1e-6) * questions_.steps().step_s();
  bool ok = true;
  for (std::uint32_t i = 0; i < scene_.size() && ok; ++i) {
    if (EndOfUnit(i) <= end_s) continue;
    chosen_.clear();
    Choose(i);
    ok = PlanChosen(1, Replan(i));
    if (!ok) break;
    for (const Before& b : chosen_) UpdateConflicts(b.unit);
  }
  ok = ok && RepairAll(kRepairsPerCut);
  in_cut_ = false;
  if (ok) return true;
  end_step_ = end_before;
  PutBack(before_cut_);
  conflicts_.clear();
  return false;
}

void DenseSearch::Improve() {
  const double h = questions_.steps().step_s();
  const double begun_s = Work_s();
  int failures = 0;
  double share = kCutShare;
  const auto least_step = static_cast<std::int32_t>(std::ceil(q_.within_s / h - 1e-6));
  while (Work_s() - begun_s < options_.improve_cpu_s && !IsAbandoned(q_.abandoned)) {
    double end_s = 0;
    for (std::uint32_t i = 0; i < scene_.size(); ++i) end_s = std::max(end_s, EndOfUnit(i));
    if (end_s <= kGoodEnough * q_.within_s) break;
    const auto now = static_cast<std::int32_t>(std::ceil(end_s / h - 1e-6));
    const auto cut =
        std::max<std::int32_t>(1, static_cast<std::int32_t>(share * (end_s - q_.within_s) / h));
    const std::int32_t to = std::max(now - cut, least_step);
    if (to >= now) break;
    if (CutTo(to)) {
      failures = 0;
      share = std::min(2 * share, kCutShare);
    } else {
      share /= 2;
      if (cut == 1 && ++failures >= kFailuresMost) break;
    }
  }
}

LocalSearchResult DenseSearch::Run() {
  LocalSearchResult result;
  Begin();
  const bool complete = CompleteFirst();
  if (complete) Improve();
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (scene_.is_place(i) && (motions_.track(i).legs().empty() || motions_.InConflict(i)))
      result.in_conflict.push_back(i);
  motions_.MoveInto(&result);
  result.work_s = Work_s();
  return result;
}

}  // namespace

LocalSearchResult SearchDense(const LocalSearchRequest& request,
                              const DenseSearchOptions& options) {
  return DenseSearch(request, options).Run();
}

}  // namespace focalfleet
