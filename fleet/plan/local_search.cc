#include "fleet/plan/local_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <limits>
#include <utility>

#include "fleet/plan/time_search.h"
#include "protocol/base/check.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kLooksPerUnit = 16;
/// The time that a unit may take grows once it has looked this often, by so much each time.
constexpr int kLooksInTime = 5;
constexpr double kExtension = 0.03;
constexpr double kWithin = 1.005;  // times the time that may be used without being noticed
/// Whoever ends later than this in the end tries again, with less and less success to hope for.
constexpr double kWorthTightening = 1.1;
constexpr std::array kTightenTo{1.005, 1.03, 1.1};
constexpr int kLooksToTighten = 8;
constexpr int kTurnsToTighten = 12;  // of all units together
/// Ways with long waits hardly ever help where the search in time finds none: not before this look.
constexpr int kLooksWithoutWaits = 2;
constexpr int kLooksAlone = 3;
constexpr int kLooksWithNotice = 3;
constexpr float kApart = 1e6F;  // weight of a neighbour that must not be met

std::uint32_t BeginOf(const AxisPaths& path) {
  std::uint32_t begin = std::numeric_limits<std::uint32_t>::max();
  for (const AxisPath& axis : path)
    if (axis.size() > 0) begin = std::min(begin, axis.segments().front().start_ticks);
  return begin;
}

class Repair {
 public:
  explicit Repair(const LocalSearchRequest& request)
      : q_(request), scene_(*request.scene), rng_(Rng::Stream(request.seed, "choreography")) {}

  LocalSearchResult Run();

 private:
  struct Motion {
    AxisPaths path;
    Track track;
  };
  void Begin();
  void Drain(int turns_most);
  void Tighten();
  bool Tighten(std::uint32_t unit, double extend);
  [[nodiscard]] double ExtensionAt(int looks) const {
    return std::min(extend_most_, kWithin + kExtension * std::max(0, looks - kLooksInTime));
  }
  void Improve(std::uint32_t unit);
  double Cost(std::uint32_t unit, const Track& track, double limit);
  [[nodiscard]] bool Meets(std::uint32_t unit, const Track& track, std::uint32_t slot);
  [[nodiscard]] bool InConflict(std::uint32_t unit);
  [[nodiscard]] bool IsGiven(std::uint32_t unit) const {
    return !q_.given.empty() && q_.given[unit] != 0;
  }
  void Push(std::uint32_t unit);
  [[nodiscard]] const Tolerance& ToleranceOf(std::uint32_t unit, std::uint32_t slot) const {
    return unnoticed_[unit][slot] != 0 ? without_notice_ : q_.tolerance;
  }
  [[nodiscard]] std::uint32_t SlotOf(std::uint32_t unit, std::uint32_t other) const;
  void GiveUpNotice(std::uint32_t unit, std::uint32_t slot);
  [[nodiscard]] bool Reaches(std::uint32_t unit, const AxisPaths& paths) const;
  Way WayAmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                       std::uint32_t other, std::span<const Pose> poses);
  [[nodiscard]] std::vector<Candidate> WaysViaCell(std::uint32_t unit, std::uint32_t other,
                                                   double within_s);
  void PushMet(std::uint32_t unit);
  bool SearchWay(std::uint32_t unit, double end_s, int looks);
  [[nodiscard]] std::vector<Candidate> AllWays(std::uint32_t unit, double within_s) const;
  bool TakeFirst(std::uint32_t unit, std::vector<Candidate>* ways);
  bool GoAround(std::uint32_t unit, std::uint32_t other);
  bool GoViaCell(std::uint32_t unit, std::uint32_t other);
  bool GoAlong(std::uint32_t unit, const Way& way);
  double Best(std::uint32_t unit, double extend, std::size_t from, std::size_t* chosen);
  void Take(std::uint32_t unit, const Candidate& candidate);
  void Go(std::uint32_t unit, const AxisPaths& paths, Track track);
  [[nodiscard]] bool KeepsLimits(std::uint32_t unit, const AxisPaths& paths) const;
  void BeginWithinLimits(std::uint32_t unit);

  const LocalSearchRequest& q_;
  const Scene& scene_;
  Rng rng_;
  Tolerance without_notice_;
  LocalSearchResult out_;
  std::vector<std::vector<std::uint8_t>> unnoticed_;  // by unit and slot: the pair has no notice
  std::vector<std::vector<float>> weight_;            // by unit and neighbour's slot
  std::vector<std::vector<std::uint32_t>> order_;     // slots, those that mattered last first
  std::vector<std::uint8_t> queued_;
  std::vector<std::uint8_t> looks_;
  std::deque<std::uint32_t> queue_;
  int looks_most_ = kLooksPerUnit;
  double extend_most_ = kNever;
  bool tightens_ = false;
  std::vector<std::pair<std::uint32_t, Motion>> before_;  // of who went otherwise since
  std::vector<Candidate> candidates_;
  Track track_;
  TimeSearch search_;
  PathSearch path_search_;
  std::vector<Passer> passers_;
  std::vector<Blocker> blockers_;
};

bool Repair::Meets(std::uint32_t unit, const Track& track, std::uint32_t slot) {
  const NeighbourNeed& near = scene_.neighbours(unit)[slot];
  if (!scene_.is_place(near.unit) || out_.tracks[near.unit].legs().empty()) return false;
  if (IsGiven(unit) && IsGiven(near.unit)) return false;
  const Tolerance& tolerance = ToleranceOf(unit, slot);
  const Track& other = out_.tracks[near.unit];
  if (!track.moves() && !other.moves()) return false;
  // Near touching the order of the two may matter: it is always the same.
  return unit < near.unit ? !PassesClear(scene_.arm(unit), track, scene_.arm(near.unit), other,
                                         near.need_mm, tolerance)
                          : !PassesClear(scene_.arm(near.unit), other, scene_.arm(unit), track,
                                         near.need_mm, tolerance);
}

/// Sum of the weights of the neighbours that it would meet; at least `limit` once that is reached.
double Repair::Cost(std::uint32_t unit, const Track& track, double limit) {
  // Where it merely stands no plan has brought it.
  for (const StandingThing& thing : scene_.standing(unit))
    if (track.moves() && !PassesClearOf(scene_.arm(unit), track, thing.capsule, thing.need_mm))
      return kNever;
  double cost = 0;
  std::vector<std::uint32_t>& order = order_[unit];
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::uint32_t slot = order[k];
    if (!Meets(unit, track, slot)) continue;
    if (q_.movable[scene_.neighbours(unit)[slot].unit] == 0) return kNever;
    cost += static_cast<double>(weight_[unit][slot]);
    if (k > 0) std::swap(order[k], order[k - 1]);
    if (cost >= limit) return cost;
  }
  return cost;
}

/// Whoever the unit meets looks again.
void Repair::PushMet(std::uint32_t unit) {
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot)
    if (Meets(unit, out_.tracks[unit], slot)) Push(scene_.neighbours(unit)[slot].unit);
}

/// Meets somebody, or something that never moves.
bool Repair::InConflict(std::uint32_t unit) { return Cost(unit, out_.tracks[unit], kNever) > 0; }

void Repair::Push(std::uint32_t unit) {
  if (queued_[unit] != 0 || q_.movable[unit] == 0) return;
  queued_[unit] = 1;
  queue_.push_back(unit);
}

bool Repair::Reaches(std::uint32_t unit, const AxisPaths& paths) const {
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    std::int32_t at = q_.from[unit][k];
    for (const Segment& segment : paths[k].segments()) at += segment.delta;
    if (at != q_.to[unit][k]) return false;
  }
  return true;
}

/// Which neighbour of `unit` the other is.
std::uint32_t Repair::SlotOf(std::uint32_t unit, std::uint32_t other) const {
  const auto near = scene_.neighbours(unit);
  const auto it = std::find_if(near.begin(), near.end(),
                               [&](const NeighbourNeed& n) { return n.unit == other; });
  return static_cast<std::uint32_t>(it - near.begin());
}

void Repair::GiveUpNotice(std::uint32_t unit, std::uint32_t slot) {
  unnoticed_[unit][slot] = 1;
  const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
  unnoticed_[other][SlotOf(other, unit)] = 1;
}

void Repair::Begin() {
  const std::size_t n = scene_.size();
  out_.paths.resize(n);
  out_.tracks.resize(n);
  weight_.resize(n);
  unnoticed_.resize(n);
  without_notice_ = q_.tolerance;
  without_notice_.notice_s = 0;
  order_.resize(n);
  queued_.assign(n, 0);
  looks_.assign(n, 0);
  std::vector<std::pair<double, std::uint32_t>> spare;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::size_t near = scene_.neighbours(i).size();
    weight_[i].assign(near, 1);
    unnoticed_[i].assign(near, 0);
    order_[i].resize(near);
    for (std::uint32_t k = 0; k < near; ++k) order_[i][k] = k;
    if (!scene_.is_place(i)) continue;
    if (IsGiven(i)) {
      out_.paths[i] = q_.begin_with[i];
      out_.tracks[i] = Track(scene_.arm(i), q_.drives[i], q_.from[i], out_.paths[i]);
      continue;
    }
    const bool steps_aside =
        !q_.begin_with.empty() && q_.begin_with[i][0].size() + q_.begin_with[i][1].size() > 0;
    if (q_.movable[i] == 0 || (q_.from[i] == q_.to[i] && !steps_aside)) {
      out_.tracks[i] = Track(scene_.arm(i), q_.from[i]);
      if (q_.movable[i] != 0) spare.emplace_back(-q_.within_s, i);
      continue;
    }
    const Candidate straight = Straight(q_.drives[i], q_.from[i], q_.to[i]);
    const bool begun = !q_.begin_with.empty() && Reaches(i, q_.begin_with[i]);
    if (q_.ledger == nullptr) {
      out_.paths[i] = begun ? q_.begin_with[i] : straight.path;
      out_.tracks[i] = Track(scene_.arm(i), q_.drives[i], q_.from[i], out_.paths[i]);
    }
    spare.emplace_back(straight.end_s - q_.within_s, i);
  }
  // Who has the most time to spare gives way first.
  std::sort(spare.begin(), spare.end());
  for (const auto& [time, i] : spare) Push(i);
  if (q_.ledger == nullptr) return;
  // The longest first, each as soon as its rail can feed it.
  for (auto it = spare.rbegin(); it != spare.rend() && !out_.starved; ++it)
    if (q_.from[it->second] != q_.to[it->second]) BeginWithinLimits(it->second);
}

/// Straight, as soon as the limits of power let it: both axes at once, or phi after theta.
void Repair::BeginWithinLimits(std::uint32_t unit) {
  constexpr double kStepS = 0.5;
  const Candidate straight = Straight(q_.drives[unit], q_.from[unit], q_.to[unit]);
  const double theta_s =
      std::abs(q_.to[unit][0] - q_.from[unit][0]) * SecondsPerVector(q_.drives[unit].axis[0]);
  for (double begin_s = 0; begin_s < kOffsetMaxS; begin_s += kStepS) {
    for (const double phi_s : {begin_s, q_.ledger->BeginAfter(begin_s + theta_s)}) {
      const Candidate later = Delayed(q_.drives[unit], straight, {begin_s, phi_s});
      if (later.end_s > kOffsetMaxS) continue;
      if (!q_.ledger->Enter(unit, later.path)) continue;
      out_.paths[unit] = later.path;
      out_.tracks[unit] = Track(scene_.arm(unit), q_.drives[unit], q_.from[unit], later.path);
      return;
    }
  }
  out_.starved = true;
}

/// The unit goes so from now on. Pre: that keeps the limits of power.
void Repair::Go(std::uint32_t unit, const AxisPaths& paths, Track track) {
  if (q_.ledger != nullptr) {
    q_.ledger->Remove(unit, out_.paths[unit]);
    FOCALFLEET_CHECK(q_.ledger->Enter(unit, paths));
  }
  if (tightens_)
    before_.push_back({unit, {std::move(out_.paths[unit]), std::move(out_.tracks[unit])}});
  out_.paths[unit] = paths;
  out_.tracks[unit] = std::move(track);
}

void Repair::Take(std::uint32_t unit, const Candidate& candidate) {
  Go(unit, candidate.path, Track(scene_.arm(unit), q_.drives[unit], q_.from[unit], candidate.path));
}

bool Repair::KeepsLimits(std::uint32_t unit, const AxisPaths& paths) const {
  return q_.ledger == nullptr || q_.ledger->Fits(unit, paths, out_.paths[unit]);
}

/// The least cost of the candidates from `first` on, and which.
double Repair::Best(std::uint32_t unit, double extend, std::size_t first, std::size_t* chosen) {
  double best = kNever;
  int ties = 0;
  for (std::size_t c = first; c < candidates_.size() && best > 0; ++c) {
    const Candidate& candidate = candidates_[c];
    if (candidate.end_s > std::min(q_.within_s * extend, kOffsetMaxS)) continue;
    track_ = Track(scene_.arm(unit), q_.drives[unit], q_.from[unit], candidate.path);
    const double cost = Cost(unit, track_, best == kNever ? best : best + 1e-9);
    if (cost > best || cost == kNever) continue;
    if (!KeepsLimits(unit, candidate.path)) continue;
    ties = cost < best ? 1 : ties + 1;
    if (cost == best && rng_.Below(static_cast<std::uint64_t>(ties)) != 0) continue;
    best = cost;
    *chosen = c;
  }
  return best;
}

/// A way for `unit` among what never moves, and `other` where `poses` has it; empty where there is
/// none.
Way Repair::WayAmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                             std::uint32_t other, std::span<const Pose> poses) {
  blockers_.clear();
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    if (!scene_.is_place(near.unit)) continue;
    if ((q_.movable[near.unit] != 0 && near.unit != other) || IsGiven(near.unit)) continue;
    const SegmentFp line = scene_.arm(near.unit).At(poses[near.unit]);
    blockers_.push_back({{line, 0}, near.need_mm, near.unit});
  }
  for (const StandingThing& thing : scene_.standing(unit))
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  PathSearch::Question question;
  question.arm = &scene_.arm(unit);
  question.drive = &q_.drives[unit];
  question.blockers = blockers_;
  question.from = from;
  question.within = RangeAround(*question.arm, from);
  question.goal = goal;
  for (const double grid_deg : kSearchGridsDeg) {
    question.grid_deg = grid_deg;
    Way way = path_search_.Find(question);
    if (!way.empty()) return way;
  }
  return {};
}

/// A way for `unit` among all others as they go.
bool Repair::SearchWay(std::uint32_t unit, double end_s, int looks) {
  passers_.clear();
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot) {
    const NeighbourNeed& near = scene_.neighbours(unit)[slot];
    if (scene_.is_place(near.unit))
      passers_.push_back(
          {&scene_.arm(near.unit), &out_.tracks[near.unit], near.need_mm, ToleranceOf(unit, slot)});
  }
  blockers_.clear();
  for (const StandingThing& thing : scene_.standing(unit))
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  const ArmGeometry& arm = scene_.arm(unit);
  TimeSearch::Question question{.arm = &arm,
                                .drive = &q_.drives[unit],
                                .passers = passers_,
                                .standing = blockers_,
                                .from = q_.from[unit],
                                .to = q_.to[unit],
                                .within = RangeAround(arm, q_.from[unit]),
                                .end_s = end_s};
  for (const double grid_deg : {6.0, 3.0}) {
    if (grid_deg < 6 && looks < kLooksAlone) break;
    question.grid_deg = grid_deg;
    question.expansions_max = looks < kLooksAlone ? 500 : 4000;
    const std::optional<AxisPaths> paths = search_.Find(question);
    if (!paths) continue;
    track_ = Track(arm, q_.drives[unit], q_.from[unit], *paths);
    if (Cost(unit, track_, 1) >= 1) continue;
    if (!KeepsLimits(unit, *paths)) continue;
    Go(unit, *paths, track_);
    return true;
  }
  return false;
}

/// All candidates of the unit, in every round.
std::vector<Candidate> Repair::AllWays(std::uint32_t unit, double within_s) const {
  std::vector<Candidate> ways;
  CandidateQuestion question{.scene = &scene_,
                             .drive = &q_.drives[unit],
                             .unit = unit,
                             .from = q_.from[unit],
                             .to = q_.to[unit],
                             .within_s = within_s};
  for (const CandidateRound& round : kCandidateRounds) {
    question.round = round;
    AppendCandidates(question, &ways);
  }
  std::erase_if(ways, [&](const Candidate& way) { return way.end_s > within_s; });
  return ways;
}

/// Ways of the unit through its cell that leave `other` alone, first where that starts, at last
/// where that ends.
std::vector<Candidate> Repair::WaysViaCell(std::uint32_t unit, std::uint32_t other,
                                           double within_s) {
  std::vector<Candidate> ways;
  if (!scene_.HasCell(unit)) return ways;
  PoseBox cell = scene_.arm(unit).range();
  cell.low[1] = std::max(cell.low[1], scene_.cell(unit).low);
  cell.high[1] = std::min(cell.high[1], scene_.cell(unit).high);
  if (cell.low[1] > cell.high[1]) return ways;
  const Way in = WayAmongStanding(unit, q_.from[unit], cell, other, q_.from);
  const Way out = WayAmongStanding(unit, q_.to[unit], cell, other, q_.to);
  AppendVia({.scene = &scene_,
             .drive = &q_.drives[unit],
             .unit = unit,
             .from = q_.from[unit],
             .to = q_.to[unit],
             .within_s = within_s},
            in, out, &ways);
  std::erase_if(ways, [&](const Candidate& way) { return way.end_s > within_s; });
  return ways;
}

/// The first of the ways, in this order, that meets nobody; `ways` loses those that were looked at.
bool Repair::TakeFirst(std::uint32_t unit, std::vector<Candidate>* ways) {
  for (std::size_t k = 0; k < ways->size(); ++k) {
    const Candidate& way = (*ways)[k];
    track_ = Track(scene_.arm(unit), q_.drives[unit], q_.from[unit], way.path);
    if (Cost(unit, track_, 1) >= 1 || !KeepsLimits(unit, way.path)) continue;
    Go(unit, way.path, track_);
    ways->erase(ways->begin(), ways->begin() + static_cast<std::ptrdiff_t>(k) + 1);
    return true;
  }
  ways->clear();
  return false;
}

/// `other` goes in one of its own ways that meet nobody else, and `unit` finds one around it. True:
/// neither meets anybody then.
bool Repair::GoAround(std::uint32_t unit, std::uint32_t other) {
  const Motion before{out_.paths[unit], out_.tracks[unit]};
  const Motion other_before{out_.paths[other], out_.tracks[other]};
  const double within_s = q_.within_s * ExtensionAt(looks_[unit]);
  const int looks = looks_[unit];
  Go(unit, {}, Track());
  std::vector<Candidate> ways = AllWays(other, within_s);
  const int tries = looks < kLooksAlone ? 2 : 6;
  for (int k = 0; k < tries && !ways.empty(); ++k) {
    // Still there as long as can be, or gone as soon: that leaves the most room at the one end or
    // the other.
    if (k == 0)
      std::stable_sort(ways.begin(), ways.end(), [](const Candidate& x, const Candidate& y) {
        return BeginOf(x.path) > BeginOf(y.path);
      });
    else if (k == 1)
      std::stable_sort(ways.begin(), ways.end(),
                       [](const Candidate& x, const Candidate& y) { return x.end_s < y.end_s; });
    else
      for (std::size_t n = ways.size(); n > 1; --n) std::swap(ways[n - 1], ways[rng_.Below(n)]);
    if (!TakeFirst(other, &ways)) break;
    if (SearchWay(unit, within_s, looks)) return true;
    if (k <= 1 && looks >= kLooksAlone && looks % 2 == 1 &&
        GoAlong(unit, WayAmongStanding(unit, q_.from[unit], PoseBox::Of(q_.to[unit]), other,
                                       k == 0 ? q_.from : q_.to)))
      return true;
  }
  if (looks >= kLooksAlone && GoViaCell(unit, other)) return true;
  Go(unit, {}, Track());
  Go(other, other_before.path, other_before.track);
  Go(unit, before.path, before.track);
  return false;
}

/// `other` goes through its own cell, and `unit` around it. True: neither meets the other then, and
/// whom else they meet looks again.
bool Repair::GoViaCell(std::uint32_t unit, std::uint32_t other) {
  const int looks = looks_[unit];
  const double within_s = q_.within_s * ExtensionAt(looks);
  const std::vector<Candidate> ways = WaysViaCell(other, unit, within_s);
  std::vector<Candidate> clear = ways;
  while (!clear.empty() && TakeFirst(other, &clear))
    if (SearchWay(unit, within_s, looks)) return true;
  if (looks < kLooksInTime) return false;
  // Where nothing else helps, third ones have to find another way.
  for (const Candidate& way : ways) {
    track_ = Track(scene_.arm(other), q_.drives[other], q_.from[other], way.path);
    if (Cost(other, track_, kNever) == kNever || !KeepsLimits(other, way.path)) continue;
    Go(other, way.path, track_);
    if (SearchWay(unit, within_s, looks)) {
      PushMet(other);
      return true;
    }
    candidates_ = WaysViaCell(unit, kNobody, within_s);
    for (const Candidate& own : AllWays(unit, within_s)) candidates_.push_back(own);
    const std::size_t slot = SlotOf(unit, other);
    const float weight = std::exchange(weight_[unit][slot], kApart);
    std::size_t chosen = 0;
    const double best = Best(unit, ExtensionAt(looks), 0, &chosen);
    weight_[unit][slot] = weight;
    if (best >= static_cast<double>(kApart)) continue;
    Take(unit, candidates_[chosen]);
    PushMet(unit);
    PushMet(other);
    return true;
  }
  return false;
}

/// The search in time has a coarse grid; among things that stand there is a finer one. True: the
/// unit goes along that way, and whom it meets looks again.
bool Repair::GoAlong(std::uint32_t unit, const Way& way) {
  const double extend = ExtensionAt(looks_[unit]);
  candidates_.clear();
  AppendAlong({.scene = &scene_,
               .drive = &q_.drives[unit],
               .unit = unit,
               .from = q_.from[unit],
               .to = q_.to[unit],
               .within_s = q_.within_s * extend},
              way, &candidates_);
  std::size_t chosen = 0;
  const double best = Best(unit, extend, 0, &chosen);
  // Only where nothing else helps third ones have to find another way.
  if (best == kNever || (best >= 1 && looks_[unit] < kLooksInTime)) return false;
  Take(unit, candidates_[chosen]);
  PushMet(unit);
  return true;
}

/// The best candidate of the unit as the others go now.
void Repair::Improve(std::uint32_t unit) {
  if (!InConflict(unit)) return;
  const int looks = looks_[unit]++;
  const double extend = ExtensionAt(looks);
  double best = kNever;
  std::size_t chosen = 0;
  candidates_.clear();
  CandidateQuestion question{.scene = &scene_,
                             .drive = &q_.drives[unit],
                             .unit = unit,
                             .from = q_.from[unit],
                             .to = q_.to[unit],
                             .within_s = q_.within_s * extend};
  for (const CandidateRound& round : kCandidateRounds) {
    if (round.first > 0 && looks < kLooksWithoutWaits) break;
    question.round = round;
    const std::size_t first = candidates_.size();
    AppendCandidates(question, &candidates_);
    std::size_t here = 0;
    const double cost = Best(unit, extend, first, &here);
    if (cost < best) {
      best = cost;
      chosen = here;
    }
    if (best < 1) break;
  }
  if (best == kNever && looks >= 1) {
    // What stands is in every way: one around it.
    candidates_.clear();
    AppendAlong(question,
                WayAmongStanding(unit, q_.from[unit], PoseBox::Of(q_.to[unit]), kNobody, q_.from),
                &candidates_);
    best = Best(unit, extend, 0, &chosen);
  }
  if (best < 1) {
    Take(unit, candidates_[chosen]);
    return;
  }
  if (looks >= 1 || best == kNever) {
    if (SearchWay(unit, q_.within_s * extend, looks)) return;
    Push(unit);
  }
  if (best != kNever) Take(unit, candidates_[chosen]);
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot) {
    if (!Meets(unit, out_.tracks[unit], slot)) continue;
    const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
    if (looks >= 1 && q_.movable[other] != 0 && (GoAround(unit, other) || GoAround(other, unit))) {
      Push(unit);
      Push(other);
      return;
    }
    if (looks >= kLooksWithNotice) GiveUpNotice(unit, slot);
    weight_[unit][slot] += 1;
    weight_[other][SlotOf(other, unit)] += 1;
    Push(other);
    Push(unit);
  }
}

/// Whoever waits to look does, one after the other; at most so many, then nobody waits any more.
void Repair::Drain(int turns_most) {
  for (int turn = 0; !queue_.empty(); ++turn) {
    if (IsAbandoned(q_.abandoned)) turns_most = 0;
    const std::uint32_t unit = queue_.front();
    queue_.pop_front();
    queued_[unit] = 0;
    if (turn < turns_most && looks_[unit] < looks_most_) Improve(unit);
  }
}

/// Straight again and repaired again, in less time. False: that found no end, and all go as before.
bool Repair::Tighten(std::uint32_t unit, double extend) {
  before_.clear();
  const std::vector<std::vector<std::uint8_t>> unnoticed = unnoticed_;
  tightens_ = true;
  looks_most_ = kLooksToTighten;
  extend_most_ = extend;
  std::fill(looks_.begin(), looks_.end(), std::uint8_t{1});
  Take(unit, Straight(q_.drives[unit], q_.from[unit], q_.to[unit]));
  Push(unit);
  PushMet(unit);
  Drain(kTurnsToTighten);
  tightens_ = false;
  const bool clear = std::none_of(before_.begin(), before_.end(),
                                  [&](const auto& made) { return InConflict(made.first); });
  if (clear) return true;
  for (auto it = before_.rbegin(); it != before_.rend(); ++it) {
    out_.paths[it->first] = std::move(it->second.path);
    out_.tracks[it->first] = std::move(it->second.track);
  }
  unnoticed_ = unnoticed;
  return false;
}

/// The last ones may have been late for want of luck.
void Repair::Tighten() {
  if (q_.ledger != nullptr) return;  // power is what takes the time
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (IsGiven(i) || IsAbandoned(q_.abandoned)) continue;
    for (const double extend : kTightenTo) {
      const double end_s =
          out_.paths[i][0].size() + out_.paths[i][1].size() == 0 ? 0 : out_.tracks[i].end_s();
      if (end_s <= q_.within_s * std::max(kWorthTightening, extend)) break;
      if (Tighten(i, extend)) break;
    }
  }
}

LocalSearchResult Repair::Run() {
  Begin();
  if (out_.starved) return std::move(out_);
  Drain(std::numeric_limits<int>::max());
  Tighten();
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (scene_.is_place(i) && InConflict(i)) out_.in_conflict.push_back(i);
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    for (std::uint32_t slot = 0; slot < unnoticed_[i].size(); ++slot)
      if (const std::uint32_t j = scene_.neighbours(i)[slot].unit;
          unnoticed_[i][slot] != 0 && i < j)
        out_.without_notice.emplace_back(i, j);
  return std::move(out_);
}

}  // namespace

LocalSearchResult SearchLocally(const LocalSearchRequest& request) { return Repair(request).Run(); }

}  // namespace focalfleet
