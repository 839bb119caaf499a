#include "fleet/plan/replan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>

#include "fleet/plan/candidates.h"
#include "fleet/plan/guarantee.h"
#include "fleet/plan/time_search.h"

namespace focalfleet {
namespace {

constexpr double kTickS = 1e-4;
constexpr double kGuardMm = 1.5e-4;  // of a pair that may be as near as the rule allows
constexpr double kCoverSlackMm = 0.05;
/// Grids of the searches among the others as they go, and as they stand in the end: as fine as an
/// answer within some milliseconds allows.
struct Effort {
  double grid_deg;
  std::uint32_t expansions_max;
};
constexpr std::array kGridsAtRestDeg{3.0, 1.5};
constexpr std::array kEfforts{Effort{6, 300}, Effort{3, 600}};

AxisPaths Later(const AxisPaths& paths, std::uint32_t by_ticks) {
  AxisPaths later;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (Segment segment : paths[k].segments()) {
      segment.start_ticks += by_ticks;
      later[k].Append(segment);
    }
  }
  return later;
}

AxisPaths Sooner(const AxisPaths& paths, std::uint32_t by_ticks) {
  return Later(paths, 0u - by_ticks);  // modulo 2^32, and none begins before
}

std::uint32_t TicksOf(double t_s) { return static_cast<std::uint32_t>(std::llround(t_s / kTickS)); }

Way Reversed(const Way& way) {
  Way reversed(way.size());
  for (std::size_t k = 0; k < way.size(); ++k) {
    reversed[k] = way[way.size() - 1 - k];
    reversed[k].out_of_step = k == 0 ? 1 : way[way.size() - k].out_of_step;
  }
  return reversed;
}

bool IsEmpty(const AxisPaths& paths) { return paths[0].size() + paths[1].size() == 0; }

}  // namespace

/// One answer: what is near the unit, and the search among it.
class Replanner {
 public:
  Replanner(const RunningPlan& running, const ReplanQuestion& question,
            std::span<const Deviation> deviations)
      : running_(running), scene_(running.scene_), q_(question), deviations_(deviations) {}

  Result<LateMove> Run();
  Status Check();

 private:
  /// A neighbour with a place, in the configuration's time.
  struct Other {
    std::uint32_t unit = 0;
    Track track;
    Pose ends{};
    double skew_s = 0;
    double need_mm = 0;
    Tolerance tolerance;  // of the pair, with notice
    std::uint32_t met = 0;
  };
  static constexpr std::size_t kThing = SIZE_MAX;  // not one of the others

  [[nodiscard]] Status CheckQuestion() const;
  [[nodiscard]] Status CheckTarget() const;
  void LookAround();
  void AddOther(const NeighbourNeed& near, const Deviation* deviation);
  void AddCover(const NeighbourNeed& near, const UnitKnowledge& knowledge);
  void AllowFor(Other* other, const Pose& starts) const;
  [[nodiscard]] Tolerance ToleranceOf(const Other& other, bool with_notice) const;
  [[nodiscard]] Track TrackOf(const AxisPaths& own) const {
    return {arm(), drive(), q_.from, Later(own, start_ticks_)};
  }
  bool IsClear(const Track& track, bool with_notice);
  bool Take(const AxisPaths& own, bool with_notice);
  bool TakeOneOf(bool with_notice);
  void Candidates(double within_s);
  bool Search(double end_s, bool with_notice);
  [[nodiscard]] Way WayInTheEnd(double grid_deg, bool backwards, std::size_t* reached) const;
  bool TakeAlong(const Way& way);
  bool GoWhenAllStand();
  bool FindWay();
  [[nodiscard]] double OthersEnd() const;
  void EnterPower();
  LateMove Finish();
  [[nodiscard]] Error NoWay() const;
  [[nodiscard]] std::string NameOf(std::uint32_t unit) const {
    return "unit " + std::to_string(running_.layout_->unit({unit}).id.value);
  }
  [[nodiscard]] const ArmGeometry& arm() const { return scene_.arm(q_.unit.value); }
  [[nodiscard]] const UnitDrive& drive() const { return running_.drives_[q_.unit.value]; }

  const RunningPlan& running_;
  const Scene& scene_;
  const ReplanQuestion& q_;
  std::span<const Deviation> deviations_;
  std::uint32_t start_ticks_ = 0;
  double start_s_ = 0;
  std::vector<Other> others_;
  std::vector<std::size_t> order_;  // of others_, those that were met last first
  std::vector<Blocker> standing_;
  std::uint32_t things_met_ = 0;
  std::uint32_t thing_ = kNobody;  // met last, of those that stand for good
  std::optional<PowerLedger> ledger_;
  std::uint32_t short_of_power_ = 0;
  std::vector<Candidate> candidates_;
  std::vector<std::size_t> by_end_;
  AxisPaths own_;  // taken, from its own start signal
  Track track_;    // of own_
};

Status Replanner::CheckQuestion() const {
  if (q_.unit.value >= scene_.size()) return Fail(ErrorCode::kInvalid, "there is no such unit");
  const std::string name = NameOf(q_.unit.value);
  // Written so that what is not a number fails.
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

/// Where the others end, or stand, the target has to be clear for good.
Status Replanner::CheckTarget() const {
  const SegmentFp line = arm().At(q_.to);
  const std::string target = "the target of " + NameOf(q_.unit.value);
  std::string text;
  for (const Other& other : others_) {
    const double distance = DistanceMm(line, scene_.arm(other.unit).At(other.ends));
    const double need = scene_.FullNeed(q_.unit.value, other.unit);
    if (distance >= need - kClearToleranceMm) continue;
    std::array<char, 200> words{};
    std::snprintf(words.data(), words.size(),
                  "%s%s and the place where %s ends are %.4f mm apart, %.4f mm needed",
                  text.empty() ? "" : "; ", target.c_str(), NameOf(other.unit).c_str(), distance,
                  need);
    text += words.data();
  }
  std::uint32_t named = q_.unit.value;
  for (const Blocker& thing : standing_) {
    if (thing.by == named) continue;
    if (DistanceMm(line, thing.capsule.line) > thing.capsule.radius_mm + thing.need_mm) continue;
    named = thing.by;
    text += (text.empty() ? "" : "; ") + target + " is not clear of " +
            (named == kNobody ? "a fixed obstacle" : "where " + NameOf(named) + " may stand");
  }
  if (!text.empty()) return Fail(ErrorCode::kInvalid, text);
  return {};
}

Tolerance Replanner::ToleranceOf(const Other& other, bool with_notice) const {
  Tolerance tolerance = other.tolerance;
  if (!with_notice) tolerance.notice_s = 0;
  return tolerance;
}

/// A pair may stand as near as the rule allows where it starts or ends, as in Scene::AllowFor.
void Replanner::AllowFor(Other* other, const Pose& starts) const {
  const double least = scene_.FullNeed(q_.unit.value, other->unit) - kClearToleranceMm;
  for (const Pose& mine : {q_.from, q_.to}) {
    for (const Pose& theirs : {starts, other->ends}) {
      const double distance = DistanceMm(arm().At(mine), scene_.arm(other->unit).At(theirs));
      other->need_mm = std::max(least, std::min(other->need_mm, distance - kGuardMm));
    }
  }
}

void Replanner::AddCover(const NeighbourNeed& near, const UnitKnowledge& knowledge) {
  const ArmGeometry& other = scene_.arm(near.unit);
  for (const Capsule& capsule : CoverOf(other, BoxOf(other, knowledge), kCoverSlackMm))
    standing_.push_back({capsule, near.need_mm, near.unit});
}

void Replanner::AddOther(const NeighbourNeed& near, const Deviation* deviation) {
  const std::uint32_t j = near.unit;
  const ArmGeometry& other_arm = scene_.arm(j);
  Other other;
  other.unit = j;
  other.need_mm = near.need_mm;
  other.skew_s = running_.options_.start_skew_s;
  Pose starts = running_.from_[j];
  if (deviation == nullptr) {
    other.ends = running_.to_[j];
    other.track = Track(other_arm, running_.drives_[j], starts, running_.paths_[j]);
  } else if (deviation->goes) {
    const LateMove& late = *deviation->goes;
    starts = late.move.from;
    other.ends = late.move.to;
    other.skew_s = late.start_skew_s;
    other.track =
        Track(other_arm, running_.drives_[j], starts, Later(late.move.path, TicksOf(late.start_s)));
  } else {
    starts = other.ends = PlaceOf(deviation->stands);
    other.track = Track(other_arm, starts);
  }
  other.tolerance = {(other.skew_s + q_.start_skew_s) / 2, running_.options_.clock_error,
                     running_.options_.notice_s};
  AllowFor(&other, starts);
  others_.push_back(std::move(other));
}

void Replanner::LookAround() {
  std::vector<std::uint32_t> deviating;
  for (const NeighbourNeed& near : scene_.neighbours(q_.unit.value)) {
    const auto it =
        std::find_if(deviations_.begin(), deviations_.end(),
                     [&](const Deviation& deviation) { return deviation.unit.value == near.unit; });
    const Deviation* deviation = it == deviations_.end() ? nullptr : &*it;
    if (deviation != nullptr) deviating.push_back(near.unit);
    const bool is_place = deviation == nullptr
                              ? scene_.is_place(near.unit)
                              : deviation->goes.has_value() || IsPlace(deviation->stands);
    if (is_place)
      AddOther(near, deviation);
    else if (deviation != nullptr)
      AddCover(near, deviation->stands);
  }
  for (const StandingThing& thing : scene_.standing(q_.unit.value)) {
    // Of whom it stands for, more may be known by now.
    if (std::find(deviating.begin(), deviating.end(), thing.by) != deviating.end()) continue;
    double need_mm = thing.need_mm;
    if (thing.by == kNobody)
      for (const Pose& pose : {q_.from, q_.to})
        need_mm =
            std::max(thing.least_mm,
                     std::min(need_mm, DistanceMm(arm().At(pose), thing.capsule.line) - kGuardMm));
    standing_.push_back({thing.capsule, need_mm, thing.by});
  }
  order_.resize(others_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
}

bool Replanner::IsClear(const Track& track, bool with_notice) {
  for (const Blocker& thing : standing_) {
    if (PassesClearOf(arm(), track, thing.capsule, thing.need_mm)) continue;
    ++things_met_;
    thing_ = thing.by;
    return false;
  }
  for (std::size_t k = 0; k < order_.size(); ++k) {
    Other& other = others_[order_[k]];
    if (PassesClearSince(q_.now_s, arm(), track, scene_.arm(other.unit), other.track, other.need_mm,
                         ToleranceOf(other, with_notice)))
      continue;
    ++other.met;
    std::rotate(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(k),
                order_.begin() + static_cast<std::ptrdiff_t>(k) + 1);
    return false;
  }
  return true;
}

bool Replanner::Take(const AxisPaths& own, bool with_notice) {
  Track track = TrackOf(own);
  if (!IsClear(track, with_notice)) return false;
  if (ledger_ && !ledger_->Enter(q_.unit.value, Later(own, start_ticks_))) {
    ++short_of_power_;
    return false;
  }
  own_ = own;
  track_ = std::move(track);
  return true;
}

/// The candidate that ends soonest of those that are clear.
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

/// A way among all others as they go.
bool Replanner::Search(double end_s, bool with_notice) {
  std::vector<Passer> passers;
  for (const Other& other : others_)
    passers.push_back(
        {&scene_.arm(other.unit), &other.track, other.need_mm, ToleranceOf(other, with_notice)});
  TimeSearch search;
  TimeSearch::Question question{.arm = &arm(),
                                .drive = &drive(),
                                .passers = passers,
                                .standing = standing_,
                                .from = q_.from,
                                .to = q_.to,
                                .within = RangeAround(arm(), q_.from),
                                .begin_s = start_s_,
                                .end_s = end_s};
  for (const Effort& effort : kEfforts) {
    question.grid_deg = effort.grid_deg;
    question.expansions_max = effort.expansions_max;
    const std::optional<AxisPaths> paths = search.Find(question);
    if (paths && Take(Sooner(*paths, start_ticks_), with_notice)) return true;
  }
  return false;
}

/// By then everybody near is where they stay.
double Replanner::OthersEnd() const {
  double end_s = 0;
  for (const Other& other : others_)
    end_s = std::max(
        end_s, other.track.end_s() + other.tolerance.Slip(other.track.end_s() + Track::kSliceS));
  return end_s;
}

/// A way among the others as they stand in the end; empty: none on this grid. `reached`: how many
/// poses were, where there is none.
Way Replanner::WayInTheEnd(double grid_deg, bool backwards, std::size_t* reached) const {
  std::vector<Blocker> blockers = standing_;
  for (const Other& other : others_)
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

/// Waits until the others have ended, and goes along a way among them as they stand then.
bool Replanner::GoWhenAllStand() {
  // Where there is no way the start or the target is shut in: the fine search begins at that end,
  // where it soon knows.
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
  along.within_s = std::max(0.0, OthersEnd() - start_s_) + candidates_.front().end_s;
  AppendAlong(along, way, &candidates_);
  return TakeOneOf(true);
}

/// Within the time that the others take anyhow, then after them, at last without notice.
bool Replanner::FindWay() {
  const double straight_s = Straight(drive(), q_.from, q_.to).end_s;
  const double within_s = std::max(straight_s, running_.end_s_ - start_s_);
  Candidates(within_s);
  if (TakeOneOf(true) || Search(start_s_ + within_s, true)) return true;
  // Folded all the way in and out again, once the others stand.
  const PoseBox& range = arm().range();
  const double fold_s = (range.high[1] - range.low[1]) * SecondsPerVector(drive().axis[1]);
  Candidates(std::max(0.0, OthersEnd() - start_s_) + straight_s + 2 * fold_s);
  if (TakeOneOf(true) || GoWhenAllStand()) return true;
  if (running_.options_.notice_s <= 0) return false;
  Candidates(within_s);
  return TakeOneOf(false) || Search(start_s_ + within_s, false);
}

/// What the others draw; who stands for certain draws nothing.
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
                         Later(deviation.goes->move.path, TicksOf(deviation.goes->start_s)));
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
  if (IsEmpty(own_)) return late;
  const double notice_s = running_.options_.notice_s;
  for (const Other& other : others_) {
    if (other.track.legs().size() < 2) continue;
    const bool noticed = PassesClearSince(q_.now_s, arm(), track_, scene_.arm(other.unit),
                                          other.track, other.need_mm, ToleranceOf(other, true));
    FollowingQuestion question{.ends = &track_,
                               .comes = &other.track,
                               .need_mm = other.need_mm,
                               .proven = ToleranceOf(other, noticed),
                               .skew_s = std::max(q_.start_skew_s, other.skew_s),
                               .from_s = q_.now_s,
                               .notice_s = notice_s};
    const PositionerIndex j{other.unit};
    if (const auto following = FindFollowing(question)) {
      late.move.followers.push_back(following->FollowerOf(j));
      if (following->leaves_s < notice_s)
        late.unnoticed.push_back({q_.unit, j, following->since_s, following->leaves_s});
    }
    std::swap(question.ends, question.comes);
    // It may have ended a moment ago, and nobody has noticed yet.
    question.from_s -= notice_s + question.proven.Slip(q_.now_s);
    if (const auto following = FindFollowing(question)) {
      late.leaders.push_back({j, following->FollowerOf(q_.unit)});
      if (following->leaves_s < notice_s)
        late.unnoticed.push_back({j, q_.unit, following->since_s, following->leaves_s});
    }
  }
  return late;
}

Error Replanner::NoWay() const {
  std::string text = "no way to the target of " + NameOf(q_.unit.value) + " was found";
  const auto most = std::max_element(others_.begin(), others_.end(),
                                     [](const Other& a, const Other& b) { return a.met < b.met; });
  const std::uint32_t met = most == others_.end() ? 0 : most->met;
  if (short_of_power_ > std::max(met, things_met_))
    text += " within the limits of power";
  else if (things_met_ > met)
    text += ": " +
            (thing_ == kNobody ? "a fixed obstacle" : "where " + NameOf(thing_) + " may stand") +
            " is in the way";
  else if (met > 0)
    text += ": " + NameOf(most->unit) + " is in the way";
  return {ErrorCode::kRefused, text};
}

Status Replanner::Check() {
  FOCALFLEET_TRY(CheckQuestion());
  LookAround();
  return CheckTarget();
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

Result<LateMove> RunningPlan::Replan(const ReplanQuestion& question,
                                     std::span<const Deviation> deviations) const {
  return Replanner(*this, question, deviations).Run();
}

Status RunningPlan::CheckTarget(const ReplanQuestion& question,
                                std::span<const Deviation> deviations) const {
  return Replanner(*this, question, deviations).Check();
}

std::vector<Result<LateMove>> RunningPlan::ReplanAll(std::span<const ReplanQuestion> questions,
                                                     std::span<const Deviation> deviations) const {
  std::vector<Deviation> all(deviations.begin(), deviations.end());
  for (const ReplanQuestion& question : questions) {
    std::erase_if(all, [&](const Deviation& d) { return d.unit == question.unit; });
    all.push_back({question.unit, Exactly(Witness::kReported, question.from), std::nullopt});
  }
  std::vector<Result<LateMove>> answers(questions.size(),
                                        Fail(ErrorCode::kRefused, "was not looked at"));
  // One may end where another still stands: who found no way asks again once somebody has left.
  for (bool left = true; left;) {
    left = false;
    for (std::size_t n = 0; n < questions.size(); ++n) {
      if (answers[n]) continue;
      answers[n] = Replan(questions[n], all);
      if (!answers[n]) continue;
      left = true;
      const auto mine = std::find_if(all.begin(), all.end(), [&](const Deviation& deviation) {
        return deviation.unit == questions[n].unit;
      });
      mine->goes = *answers[n];
    }
  }
  return answers;
}

}  // namespace focalfleet
