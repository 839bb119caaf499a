#include "fleet/plan/replan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "fleet/plan/candidates.h"
#include "fleet/plan/guarantee.h"
#include "fleet/plan/replan_neighbourhood.h"
#include "fleet/plan/service.h"
#include "fleet/plan/time_search.h"
#include "protocol/base/instants.h"

namespace focalfleet {
namespace {

/// Grids of the searches among the others as they move, and as they stand in the end. They are as
/// fine as an answer within some milliseconds allows.
struct Effort {
  double grid_deg;
  std::uint32_t expansions_max;
};
constexpr std::array kGridsAtRestDeg{3.0, 1.5};
constexpr std::array kEfforts{Effort{6, 300}, Effort{3, 600}};

Way Reversed(const Way& way) {
  Way reversed(way.size());
  for (std::size_t k = 0; k < way.size(); ++k) {
    reversed[k] = way[way.size() - 1 - k];
    reversed[k].out_of_step = k == 0 ? 1 : way[way.size() - k].out_of_step;
  }
  return reversed;
}

}  // namespace

/// The search for one answer: the search for a way of the unit in its neighbourhood.
class Replanner {
 public:
  Replanner(const RunningPlan& running, const ReplanQuestion& question,
            std::span<const Deviation> deviations)
      : running_(running),
        scene_(running.scene_),
        q_(question),
        deviations_(deviations),
        near_(running, question) {}

  Result<LateMove> Run();
  Status Check();

 private:
  using Other = ReplanNeighbourhood::Other;

  [[nodiscard]] Status CheckQuestion() const;
  [[nodiscard]] Track TrackOf(const AxisPaths& own) const {
    return {arm(), drive(), q_.from, Shifted(own, start_ticks_)};
  }
  bool Take(const AxisPaths& own, bool with_notice);
  bool TakeOneOf(bool with_notice);
  void Candidates(double within_s);
  bool Search(double end_s, bool with_notice);
  [[nodiscard]] Way WayInTheEnd(double grid_deg, bool backwards, std::size_t* reached) const;
  bool TakeAlong(const Way& way);
  bool GoWhenAllStand();
  bool FindWay();
  void EnterPower();
  LateMove Finish();
  void FindFollowersAndLeaders(LateMove* late) const;
  [[nodiscard]] Error NoWay() const;
  [[nodiscard]] const ArmGeometry& arm() const { return scene_.arm(q_.unit.value); }
  [[nodiscard]] const UnitDrive& drive() const { return running_.drives_[q_.unit.value]; }

  const RunningPlan& running_;
  const Scene& scene_;
  const ReplanQuestion& q_;
  std::span<const Deviation> deviations_;
  ReplanNeighbourhood near_;
  std::uint32_t start_ticks_ = 0;
  double start_s_ = 0;
  std::optional<PowerLedger> ledger_;
  std::uint32_t short_of_power_ = 0;
  std::vector<Candidate> candidates_;
  std::vector<std::size_t> by_end_;
  AxisPaths own_;  // taken, from its own start signal
  Track track_;    // of own_
};

Status Replanner::CheckQuestion() const {
  if (q_.unit.value >= scene_.size()) return Fail(ErrorCode::kInvalid, "there is no such unit");
  const std::string name = running_.NameOf(q_.unit.value);
  // The condition is written so that a NaN fails.
  if (!(q_.start_s >= 0 && q_.start_s < kOffsetMaxS && q_.now_s <= q_.start_s &&
        q_.start_skew_s >= 0 && q_.start_skew_s < 1))
    return Fail(ErrorCode::kInvalid, name + " cannot start then");
  if (running_.options_.stall_tolerant)
    return Fail(ErrorCode::kRefused, "a plan in stages takes no late moves");
  if (!running_.layout_->unit(q_.unit).enabled)
    return Fail(ErrorCode::kRefused, name + " is disabled in the units file");
  if (!arm().range().Contains(q_.to))
    return Fail(ErrorCode::kInvalid, "the target of " + name + " is outside its axes' ranges");
  return {};
}

bool Replanner::Take(const AxisPaths& own, bool with_notice) {
  Track track = TrackOf(own);
  if (!near_.IsClear(track, with_notice)) return false;
  if (ledger_ && !ledger_->Enter(q_.unit.value, Shifted(own, start_ticks_))) {
    ++short_of_power_;
    return false;
  }
  own_ = own;
  track_ = std::move(track);
  return true;
}

/// Takes the candidate that ends soonest of those that are clear.
bool Replanner::TakeOneOf(bool with_notice) {
  by_end_.resize(candidates_.size());
  std::iota(by_end_.begin(), by_end_.end(), std::size_t{0});
  std::stable_sort(by_end_.begin(), by_end_.end(), [&](std::size_t a, std::size_t b) {
    return candidates_[a].end_s < candidates_[b].end_s;
  });
  return std::any_of(by_end_.begin(), by_end_.end(), [&](std::size_t c) {
    return candidates_[c].end_s < kOffsetMaxS && Take(candidates_[c].path, with_notice);
  });
}

void Replanner::Candidates(double within_s) {
  candidates_.clear();
  CandidateQuestion question{.scene = &scene_,
                             .drive = &drive(),
                             .unit = q_.unit.value,
                             .from = q_.from,
                             .to = q_.to,
                             .within_s = within_s};
  for (const CandidateRound& round : kCandidateRounds) {
    question.round = round;
    AppendCandidates(question, &candidates_);
  }
}

/// Takes a way among all others as they move.
bool Replanner::Search(double end_s, bool with_notice) {
  std::vector<MovingNeighbour> moving;
  for (const Other& other : near_.others())
    moving.push_back({&scene_.arm(other.unit), &other.track, other.need_mm,
                      near_.ToleranceOf(other, with_notice)});
  TimeSearch search;
  TimeSearch::Question question{.arm = &arm(),
                                .drive = &drive(),
                                .moving = moving,
                                .standing = near_.standing(),
                                .from = q_.from,
                                .to = q_.to,
                                .within = RangeAround(arm(), q_.from),
                                .begin_s = start_s_,
                                .end_s = end_s};
  for (const Effort& effort : kEfforts) {
    question.grid_deg = effort.grid_deg;
    question.expansions_max = effort.expansions_max;
    const std::optional<AxisPaths> paths = search.Find(question);
    if (paths && Take(Shifted(*paths, -std::int64_t{start_ticks_}), with_notice)) return true;
  }
  return false;
}

/// A way among the others as they stand in the end. Empty: none on this grid; `reached` is then the
/// number of poses that were reached.
Way Replanner::WayInTheEnd(double grid_deg, bool backwards, std::size_t* reached) const {
  std::vector<Blocker> blockers(near_.standing().begin(), near_.standing().end());
  for (const Other& other : near_.others())
    blockers.push_back({{scene_.arm(other.unit).At(other.ends), 0}, other.need_mm, other.unit});
  PathSearch::Question question;
  question.arm = &arm();
  question.drive = &drive();
  question.blockers = blockers;
  question.from = backwards ? q_.to : q_.from;
  question.within = RangeAround(arm(), q_.from);
  question.goal = PoseBox::Of(backwards ? q_.from : q_.to);
  question.grid_deg = grid_deg;
  PathSearch search;
  Way way = search.Find(question);
  *reached = search.reached().size();
  return backwards ? Reversed(way) : way;
}

/// Takes a way among the others as they stand in the end, begun after they have ended.
bool Replanner::GoWhenAllStand() {
  // Where no way exists, the start or the target is shut in. The fine search begins at that end,
  // where it finishes soon.
  std::size_t from_start = 0;
  std::size_t from_end = 0;
  if (TakeAlong(WayInTheEnd(kGridsAtRestDeg[0], false, &from_start))) return true;
  if (TakeAlong(WayInTheEnd(kGridsAtRestDeg[0], true, &from_end))) return true;
  return TakeAlong(WayInTheEnd(kGridsAtRestDeg[1], from_end < from_start, &from_start));
}

bool Replanner::TakeAlong(const Way& way) {
  if (way.empty()) return false;
  CandidateQuestion along{
      .scene = &scene_, .drive = &drive(), .unit = q_.unit.value, .from = q_.from, .to = q_.to};
  candidates_.clear();
  AppendAlong(along, way, &candidates_);
  if (candidates_.empty()) return false;
  along.within_s = std::max(0.0, near_.OthersEnd() - start_s_) + candidates_.front().end_s;
  AppendAlong(along, way, &candidates_);
  return TakeOneOf(true);
}

/// Looks for a way within the time that the others take anyhow, then after them, at last without
/// notice.
bool Replanner::FindWay() {
  const double straight_s = Straight(drive(), q_.from, q_.to).end_s;
  const double within_s = std::max(straight_s, running_.end_s_ - start_s_);
  Candidates(within_s);
  if (TakeOneOf(true) || Search(start_s_ + within_s, true)) return true;
  // Time to fold all the way in and out again, once the others stand.
  const PoseBox& range = arm().range();
  const double fold_s = (range.high[1] - range.low[1]) * SecondsPerVector(drive().axis[1]);
  Candidates(std::max(0.0, near_.OthersEnd() - start_s_) + straight_s + 2 * fold_s);
  if (TakeOneOf(true) || GoWhenAllStand()) return true;
  if (running_.options_.notice_s <= 0) return false;
  Candidates(within_s);
  return TakeOneOf(false) || Search(start_s_ + within_s, false);
}

/// Enters the power of the others; a unit that stands for certain draws nothing.
void Replanner::EnterPower() {
  if (!running_.ledger_) return;
  ledger_.emplace(*running_.ledger_);
  ledger_->Remove(q_.unit.value, running_.paths_[q_.unit.value]);
  for (const Deviation& deviation : deviations_)
    if (deviation.unit != q_.unit && (deviation.goes || IsPlace(deviation.stands)))
      ledger_->Remove(deviation.unit.value, running_.paths_[deviation.unit.value]);
  for (const Deviation& deviation : deviations_) {
    if (deviation.unit == q_.unit || !deviation.goes) continue;
    ledger_->WidenSkew(deviation.goes->start_skew_s);
    ledger_->EnterAnyway(deviation.unit.value,
                         Shifted(deviation.goes->move.path, TicksOf(deviation.goes->start_s)));
  }
  ledger_->WidenSkew(q_.start_skew_s);
}

LateMove Replanner::Finish() {
  LateMove late{.move = {.unit = q_.unit,
                         .from = q_.from,
                         .to = q_.to,
                         .mode = drive().mode,
                         .path = own_,
                         .followers = {}},
                .start_s = start_s_,
                .start_skew_s = q_.start_skew_s,
                .end_s = start_s_,
                .leaders = {},
                .unnoticed = {}};
  late.end_s += EndOf(late.move, drive());
  if (!IsEmpty(own_)) FindFollowersAndLeaders(&late);
  return late;
}

/// The neighbours to stop where this unit ends early, and those whose early end stops this unit.
void Replanner::FindFollowersAndLeaders(LateMove* late) const {
  const double notice_s = running_.options_.notice_s;
  for (const Other& other : near_.others()) {
    if (other.track.legs().size() < 2) continue;
    const bool noticed =
        PassesClearSince(q_.now_s, arm(), track_, scene_.arm(other.unit), other.track,
                         other.need_mm, near_.ToleranceOf(other, true));
    FollowingQuestion question{.ends = &track_,
                               .comes = &other.track,
                               .need_mm = other.need_mm,
                               .proven = near_.ToleranceOf(other, noticed),
                               .skew_s = std::max(q_.start_skew_s, other.skew_s),
                               .from_s = q_.now_s,
                               .notice_s = notice_s};
    const PositionerIndex j{other.unit};
    if (const auto following = FindFollowing(question)) {
      late->move.followers.push_back(following->FollowerOf(j));
      if (following->leaves_s < notice_s)
        late->unnoticed.push_back({q_.unit, j, following->since_s, following->leaves_s});
    }
    std::swap(question.ends, question.comes);
    // The neighbour may have ended a moment ago, unnoticed so far.
    question.from_s -= notice_s + question.proven.Slip(q_.now_s);
    if (const auto following = FindFollowing(question)) {
      late->leaders.push_back({j, following->FollowerOf(q_.unit)});
      if (following->leaves_s < notice_s)
        late->unnoticed.push_back({j, q_.unit, following->since_s, following->leaves_s});
    }
  }
}

Error Replanner::NoWay() const {
  std::string text = "no way to the target of " + running_.NameOf(q_.unit.value) + " was found";
  const std::string in_the_way = near_.InTheWay();
  if (short_of_power_ > std::max(near_.most_met(), near_.things_met()))
    text += " within the limits of power";
  else if (!in_the_way.empty())
    text += ": " + in_the_way;
  return {ErrorCode::kRefused, text};
}

Status Replanner::Check() {
  FOCALFLEET_TRY(CheckQuestion());
  near_.LookAround(deviations_);
  return near_.CheckTarget();
}

Result<LateMove> Replanner::Run() {
  FOCALFLEET_TRY(Check());
  start_ticks_ = static_cast<std::uint32_t>(std::ceil(q_.start_s / kTickS - 1e-6));
  start_s_ = start_ticks_ * kTickS;
  EnterPower();
  if (FindWay()) return Finish();
  return tl::unexpected(NoWay());
}

RunningPlan::RunningPlan(const PlanRequest& request, std::span<const UnitPlan> moves,
                         const PlanOptions& options)
    : layout_(request.layout),
      drives_(request.drives.begin(), request.drives.end()),
      options_(options),
      scene_(*request.layout, drives_, request.start, request.offsets),
      paths_(drives_.size()) {
  for (const UnitKnowledge& k : request.start) from_.push_back(IsPlace(k) ? PlaceOf(k) : Pose{});
  to_ = from_;
  ends_.assign(request.start.begin(), request.start.end());
  const Tolerance tolerance{options.start_skew_s, options.clock_error, options.notice_s};
  if (options.power.any())
    ledger_.emplace(*layout_, drives_, options.motor, options.power, tolerance);
  for (const UnitPlan& move : moves) {
    const std::uint32_t i = move.unit.value;
    to_[i] = move.to;
    ends_[i] = Exactly(Witness::kReported, move.to);
    paths_[i] = move.path;
    end_s_ = std::max(end_s_, EndOf(move, drives_[i]));
    if (ledger_) ledger_->EnterAnyway(i, move.path);
  }
  scene_.AllowFor(from_);
  scene_.AllowFor(to_);
}

std::string RunningPlan::NameOf(std::uint32_t unit) const {
  return "unit " + UnitName(*layout_, unit);
}

Result<LateMove> RunningPlan::Replan(const ReplanQuestion& question,
                                     std::span<const Deviation> deviations) const {
  return Replanner(*this, question, deviations).Run();
}

Status RunningPlan::CheckTarget(const ReplanQuestion& question,
                                std::span<const Deviation> deviations) const {
  return Replanner(*this, question, deviations).Check();
}

}  // namespace focalfleet
