#include "fleet/plan/local_search.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <limits>
#include <utility>

#include "fleet/plan/motions.h"
#include "fleet/plan/unit_ways.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

constexpr double kImpossible = Motions::kNever;
/// Attempts of one unit. Afterwards it keeps its last way, and a search by neighbourhoods goes on
/// (dense_search.h).
constexpr int kAttemptsPerUnit = 8;
/// From this attempt on, each attempt allows the unit 3 % more time.
constexpr int kAttemptsInTime = 5;
constexpr double kExtension = 0.03;
constexpr double kWithin = 1.005;  // times the time that may be used at no cost
/// A unit that ends later than this, times that time, tries again for each of these shares.
constexpr double kWorthTightening = 1.1;
constexpr std::array kTightenTo{1.005, 1.03, 1.1};
constexpr int kAttemptsToTighten = 8;
constexpr int kTurnsToTighten = 12;  // of all units together
/// Ways with long waits hardly ever help where the search in time finds none: they are not tried
/// before this attempt.
constexpr int kAttemptsWithoutWaits = 2;
/// From this attempt on a pair tries every way around each other, those via the cell too.
constexpr int kAttemptsAlone = 3;
constexpr int kAttemptsWithNotice = 3;  // then the pair need not be clear with notice
constexpr float kApart = 1e6F;          // weight of a neighbour that must not be met

/// The search itself: which unit looks for another way next, and how far it goes for one.
class LocalSearch {
 public:
  explicit LocalSearch(const LocalSearchRequest& request)
      : q_(request),
        scene_(*request.scene),
        // The name of the stream is part of every plan: another one draws other numbers.
        rng_(Rng::Stream(request.seed, "choreography")),
        motions_(request),
        ways_(&motions_, &rng_),
        queued_(scene_.size(), 0),
        attempts_(scene_.size(), 0) {}

  LocalSearchResult Run();

 private:
  void Begin();
  bool BeginUnit(std::uint32_t unit, double* late_s);
  void BeginWithinLimits(std::uint32_t unit);
  [[nodiscard]] double TimeFor(std::uint32_t unit) const { return TimeAt(attempts_[unit]); }
  [[nodiscard]] double TimeAt(int attempts) const {
    return q_.within_s *
           std::min(extend_most_, kWithin + kExtension * std::max(0, attempts - kAttemptsInTime));
  }
  void Push(std::uint32_t unit);
  void PushMet(std::uint32_t unit);
  void Drain(int turns_most);
  void Improve(std::uint32_t unit);
  double FindCandidate(std::uint32_t unit, int attempts, std::size_t* chosen);
  void ResolveWithNeighbours(std::uint32_t unit, int attempts);
  bool GoAround(std::uint32_t unit, std::uint32_t other);
  void SortForTrial(int trial, std::vector<Candidate>* ways);
  bool GoViaCell(std::uint32_t unit, std::uint32_t other);
  bool GoApart(std::uint32_t unit, std::uint32_t other);
  bool GoAlong(std::uint32_t unit, const Way& way);
  void TightenAll();
  bool Tighten(std::uint32_t unit, double extend);

  const LocalSearchRequest& q_;
  const Scene& scene_;
  Rng rng_;
  Motions motions_;
  UnitWays ways_;
  std::vector<std::uint8_t> queued_;
  std::vector<std::uint8_t> attempts_;
  std::deque<std::uint32_t> queue_;
  int attempts_most_ = kAttemptsPerUnit;
  double extend_most_ = kImpossible;
  std::vector<Candidate> candidates_;
  bool starved_ = false;
};

void LocalSearch::Push(std::uint32_t unit) {
  if (queued_[unit] != 0 || q_.movable[unit] == 0) return;
  queued_[unit] = 1;
  queue_.push_back(unit);
}

/// Each unit that this one meets looks again.
void LocalSearch::PushMet(std::uint32_t unit) {
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot)
    if (motions_.Meets(unit, motions_.track(unit), slot)) Push(scene_.neighbours(unit)[slot].unit);
}

/// True: the unit looks for a way. `late_s` is how much later than `within_s` its straight one
/// ends.
bool LocalSearch::BeginUnit(std::uint32_t unit, double* late_s) {
  if (!scene_.is_place(unit)) return false;
  if (motions_.IsGiven(unit)) {
    motions_.Begin(unit, q_.begin_with[unit]);
    return false;
  }
  const bool steps_aside = !q_.begin_with.empty() && !IsEmpty(q_.begin_with[unit]);
  if (q_.movable[unit] == 0 || (q_.from[unit] == q_.to[unit] && !steps_aside)) {
    motions_.BeginStanding(unit);
    *late_s = -q_.within_s;
    return q_.movable[unit] != 0;
  }
  const Candidate straight = Straight(q_.drives[unit], q_.from[unit], q_.to[unit]);
  const bool begun = !q_.begin_with.empty() && Reaches(q_, unit, q_.begin_with[unit]);
  if (q_.ledger == nullptr) motions_.Begin(unit, begun ? q_.begin_with[unit] : straight.path);
  *late_s = straight.end_s - q_.within_s;
  return true;
}

void LocalSearch::Begin() {
  std::vector<std::pair<double, std::uint32_t>> late;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (double late_s = 0; BeginUnit(i, &late_s)) late.emplace_back(late_s, i);
  // The unit with the most time to spare looks first.
  std::sort(late.begin(), late.end());
  for (const auto& [time, i] : late) Push(i);
  if (q_.ledger == nullptr) return;
  // The longest first, each as soon as its rail can feed it.
  for (auto it = late.rbegin(); it != late.rend() && !starved_; ++it)
    if (q_.from[it->second] != q_.to[it->second]) BeginWithinLimits(it->second);
}

/// The unit goes straight, as soon as the limits of power let it: both axes at once, or phi after
/// theta.
void LocalSearch::BeginWithinLimits(std::uint32_t unit) {
  constexpr double kStepS = 0.5;
  const Candidate straight = Straight(q_.drives[unit], q_.from[unit], q_.to[unit]);
  const double theta_s =
      std::abs(q_.to[unit][0] - q_.from[unit][0]) * SecondsPerVector(q_.drives[unit].axis[0]);
  for (double begin_s = 0; begin_s < kOffsetMaxS; begin_s += kStepS) {
    for (const double phi_s : {begin_s, q_.ledger->BeginAfter(begin_s + theta_s)}) {
      const Candidate later = Delayed(q_.drives[unit], straight, {begin_s, phi_s});
      if (later.end_s > kOffsetMaxS) continue;
      if (!q_.ledger->Enter(unit, later.path)) continue;
      motions_.Begin(unit, later.path);
      return;
    }
  }
  starved_ = true;
}

/// `other` goes in one of its own ways that meet no third unit, and `unit` finds one around it.
/// True: neither meets any unit then.
bool LocalSearch::GoAround(std::uint32_t unit, std::uint32_t other) {
  const AxisPaths before = motions_.path(unit);
  const Track track_before = motions_.track(unit);
  const AxisPaths other_before = motions_.path(other);
  const Track other_track_before = motions_.track(other);
  const double within_s = TimeFor(unit);
  const int attempts = attempts_[unit];
  motions_.TakeOut(unit);
  std::vector<Candidate> ways = ways_.All(other, within_s);
  const int trials = attempts < kAttemptsAlone ? 2 : 6;
  for (int k = 0; k < trials && !ways.empty(); ++k) {
    SortForTrial(k, &ways);
    if (!ways_.TakeFirstClear(other, &ways)) break;
    if (ways_.TakeBySearchInTime(unit, within_s, attempts)) return true;
    if (k <= 1 && attempts >= kAttemptsAlone && attempts % 2 == 1 &&
        GoAlong(unit, ways_.AmongStanding(unit, q_.from[unit], PoseBox::Of(q_.to[unit]), other,
                                          k == 0 ? q_.from : q_.to)))
      return true;
  }
  if (attempts >= kAttemptsAlone && GoViaCell(unit, other)) return true;
  motions_.TakeOut(unit);
  motions_.Replace(other, other_before, other_track_before);
  motions_.Replace(unit, before, track_before);
  return false;
}

/// The first trial keeps the unit at its start as long as possible, the second has it gone as soon
/// as possible. Either leaves the most room at one end. Further trials are random.
void LocalSearch::SortForTrial(int trial, std::vector<Candidate>* ways) {
  if (trial == 0)
    std::stable_sort(ways->begin(), ways->end(), [](const Candidate& x, const Candidate& y) {
      return BeginTicks(x.path) > BeginTicks(y.path);
    });
  else if (trial == 1)
    std::stable_sort(ways->begin(), ways->end(),
                     [](const Candidate& x, const Candidate& y) { return x.end_s < y.end_s; });
  else
    for (std::size_t n = ways->size(); n > 1; --n)
      std::swap((*ways)[n - 1], (*ways)[rng_.Below(n)]);
}

/// `other` goes through its own cell, and `unit` around it. True: neither meets the other then, and
/// each third unit that they meet looks again.
bool LocalSearch::GoViaCell(std::uint32_t unit, std::uint32_t other) {
  const int attempts = attempts_[unit];
  const double within_s = TimeFor(unit);
  const std::vector<Candidate> ways = ways_.ViaCell(other, unit, within_s);
  std::vector<Candidate> clear = ways;
  while (!clear.empty() && ways_.TakeFirstClear(other, &clear))
    if (ways_.TakeBySearchInTime(unit, within_s, attempts)) return true;
  if (attempts < kAttemptsInTime) return false;
  // Where nothing else helps, third units have to find another way.
  for (const Candidate& way : ways) {
    Track track = motions_.TrackOf(other, way.path);
    if (motions_.Cost(other, track, kImpossible) == kImpossible ||
        !motions_.KeepsLimits(other, way.path))
      continue;
    motions_.Replace(other, way.path, std::move(track));
    if (ways_.TakeBySearchInTime(unit, within_s, attempts)) {
      PushMet(other);
      return true;
    }
    if (!GoApart(unit, other)) continue;
    PushMet(unit);
    PushMet(other);
    return true;
  }
  return false;
}

/// The unit takes its cheapest way that does not meet `other`, whatever third units it meets.
bool LocalSearch::GoApart(std::uint32_t unit, std::uint32_t other) {
  const double within_s = TimeFor(unit);
  candidates_ = ways_.ViaCell(unit, kNoUnitIndex, within_s);
  for (const Candidate& own : ways_.All(unit, within_s)) candidates_.push_back(own);
  const std::uint32_t slot = motions_.SlotOf(unit, other);
  const float weight = motions_.ExchangeWeight(unit, slot, kApart);
  std::size_t chosen = 0;
  const double best = ways_.Cheapest(unit, within_s, candidates_, 0, &chosen);
  motions_.ExchangeWeight(unit, slot, weight);
  if (best >= static_cast<double>(kApart)) return false;
  motions_.Replace(unit, candidates_[chosen].path);
  return true;
}

/// The search in time has a coarse grid; among things that stand there is a finer one. True: the
/// unit goes along that way, and each unit that it meets looks again.
bool LocalSearch::GoAlong(std::uint32_t unit, const Way& way) {
  const double within_s = TimeFor(unit);
  candidates_.clear();
  AppendAlong(ways_.QuestionFor(unit, within_s), way, &candidates_);
  std::size_t chosen = 0;
  const double best = ways_.Cheapest(unit, within_s, candidates_, 0, &chosen);
  // Only where nothing else helps third units have to find another way.
  if (best == kImpossible || (best >= 1 && attempts_[unit] < kAttemptsInTime)) return false;
  motions_.Replace(unit, candidates_[chosen].path);
  PushMet(unit);
  return true;
}

/// The cost of the cheapest candidate of the unit as the others move now; `chosen` is its index.
double LocalSearch::FindCandidate(std::uint32_t unit, int attempts, std::size_t* chosen) {
  const double within_s = TimeAt(attempts);
  double best = kImpossible;
  candidates_.clear();
  CandidateQuestion question = ways_.QuestionFor(unit, within_s);
  for (const CandidateRound& round : kCandidateRounds) {
    if (round.first > 0 && attempts < kAttemptsWithoutWaits) break;
    question.round = round;
    const std::size_t first = candidates_.size();
    AppendCandidates(question, &candidates_);
    std::size_t here = 0;
    const double cost = ways_.Cheapest(unit, within_s, candidates_, first, &here);
    if (cost < best) {
      best = cost;
      *chosen = here;
    }
    if (best < 1) break;
  }
  if (best != kImpossible || attempts < 1) return best;
  // Things that stand are in every way: the unit tries one around them.
  candidates_.clear();
  AppendAlong(
      question,
      ways_.AmongStanding(unit, q_.from[unit], PoseBox::Of(q_.to[unit]), kNoUnitIndex, q_.from),
      &candidates_);
  return ways_.Cheapest(unit, within_s, candidates_, 0, chosen);
}

/// The unit takes its best way as the others move now.
void LocalSearch::Improve(std::uint32_t unit) {
  if (!motions_.InConflict(unit)) return;
  const int attempts = attempts_[unit]++;
  std::size_t chosen = 0;
  const double best = FindCandidate(unit, attempts, &chosen);
  if (best < 1) {
    motions_.Replace(unit, candidates_[chosen].path);
    return;
  }
  if (attempts >= 1 || best == kImpossible) {
    if (ways_.TakeBySearchInTime(unit, TimeAt(attempts), attempts)) return;
    Push(unit);
  }
  if (best != kImpossible) motions_.Replace(unit, candidates_[chosen].path);
  ResolveWithNeighbours(unit, attempts);
}

/// The unit and the first neighbour that it meets find ways around each other, or every pair in
/// conflict weighs more and looks again.
void LocalSearch::ResolveWithNeighbours(std::uint32_t unit, int attempts) {
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot) {
    if (!motions_.Meets(unit, motions_.track(unit), slot)) continue;
    const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
    if (attempts >= 1 && q_.movable[other] != 0 &&
        (GoAround(unit, other) || GoAround(other, unit))) {
      Push(unit);
      Push(other);
      return;
    }
    if (attempts >= kAttemptsWithNotice) motions_.GiveUpNotice(unit, slot);
    motions_.AddWeight(unit, slot);
    Push(other);
    Push(unit);
  }
}

/// Queued units look for another way, one after the other, at most so many; the queue is empty
/// then.
void LocalSearch::Drain(int turns_most) {
  for (int turn = 0; !queue_.empty(); ++turn) {
    if (IsAbandoned(q_.abandoned)) turns_most = 0;
    const std::uint32_t unit = queue_.front();
    queue_.pop_front();
    queued_[unit] = 0;
    if (turn < turns_most && attempts_[unit] < attempts_most_) Improve(unit);
  }
}

/// Repairs once more from a straight way of this unit, within less time. False: that found no end,
/// and all move as before.
bool LocalSearch::Tighten(std::uint32_t unit, double extend) {
  motions_.BeginTrial();
  attempts_most_ = kAttemptsToTighten;
  extend_most_ = extend;
  std::fill(attempts_.begin(), attempts_.end(), std::uint8_t{1});
  motions_.Replace(unit, Straight(q_.drives[unit], q_.from[unit], q_.to[unit]).path);
  Push(unit);
  PushMet(unit);
  Drain(kTurnsToTighten);
  return motions_.EndTrial();
}

/// The units that end last may be late only by chance of the order.
void LocalSearch::TightenAll() {
  if (q_.ledger != nullptr) return;  // power is what takes the time
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    if (motions_.IsGiven(i) || IsAbandoned(q_.abandoned)) continue;
    for (const double extend : kTightenTo) {
      const double end_s = IsEmpty(motions_.path(i)) ? 0 : motions_.track(i).end_s();
      if (end_s <= q_.within_s * std::max(kWorthTightening, extend)) break;
      if (Tighten(i, extend)) break;
    }
  }
}

LocalSearchResult LocalSearch::Run() {
  LocalSearchResult result;
  Begin();
  result.starved = starved_;
  if (!starved_) {
    Drain(std::numeric_limits<int>::max());
    TightenAll();
    for (std::uint32_t i = 0; i < scene_.size(); ++i)
      if (scene_.is_place(i) && motions_.InConflict(i)) result.in_conflict.push_back(i);
  }
  motions_.MoveInto(&result);
  return result;
}

}  // namespace

bool Reaches(const LocalSearchRequest& q, std::uint32_t unit, const AxisPaths& paths) {
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    std::int32_t at = q.from[unit][k];
    for (const Segment& segment : paths[k].segments()) at += segment.delta;
    if (at != q.to[unit][k]) return false;
  }
  return true;
}

LocalSearchResult SearchLocally(const LocalSearchRequest& request) {
  return LocalSearch(request).Run();
}

}  // namespace focalfleet
