#include "fleet/plan/guarantee.h"

#include <algorithm>
#include <cmath>

namespace focalfleet {
namespace {

constexpr double kTightToMm = 1e-2;  // a reported clearance is at most this much too small

struct Nearest {
  double distance_mm = 0;
  double t_s = 0;
};

/// The least distance of two motions, where it is below `below_mm`; else a larger number.
class NearestApproach {
 public:
  NearestApproach(const ArmGeometry& arm_a, const Track& a, const ArmGeometry& arm_b,
                  const Track& b, const Tolerance& tolerance)
      : arm_a_(arm_a), arm_b_(arm_b), a_(a), b_(b), tolerance_(tolerance) {}

  Nearest Run(double below_mm) {
    best_ = {below_mm, 0};
    const int last = std::max(a_.slice_count(), b_.slice_count());
    for (int n = -1; n <= last; ++n) {
      const double slip_s = tolerance_.Slip((n + 2) * Track::kSliceS + 2);
      const int reach = static_cast<int>(slip_s / Track::kSliceS) + 1;
      for (int m = std::max(n - reach, -1); m <= std::min(n + reach, last); ++m) {
        const Slice& in_a = a_.slice(n);
        const Slice& in_b = b_.slice(m);
        const double enough = best_.distance_mm - kTightToMm + in_a.travel_mm + in_b.travel_mm;
        if (enough <= 0 || SquaredDistance(in_a.line, in_b.line) > enough * enough) continue;
        Look(TimeOf(n, a_), TimeOf(m, b_), slip_s);
      }
    }
    return best_;
  }

 private:
  struct Times {
    double low = 0;
    double high = 0;
    [[nodiscard]] double middle() const { return (low + high) / 2; }
  };
  static Times TimeOf(int n, const Track& track) {
    const double end = track.slice_count() * Track::kSliceS;
    // A stand is the same at all times: its own edge, where the other may be, stands for it.
    if (n < 0) return {-Track::kSliceS, 0};
    if (n >= track.slice_count())
      return {std::max(end, n * Track::kSliceS), (n + 1) * Track::kSliceS};
    return {n * Track::kSliceS, (n + 1) * Track::kSliceS};
  }
  static const Leg& LegAt(const Track& track, double t_s) {
    const auto legs = track.legs();
    const auto it =
        std::find_if(legs.begin(), legs.end(), [t_s](const Leg& leg) { return t_s < leg.end_s; });
    return it == legs.end() ? legs.back() : *it;
  }
  static double Travel(const Track& track, const Times& times) {
    double travel = 0;
    for (const Leg& leg : track.legs()) {
      if (leg.stands() || leg.end_s <= times.low) continue;
      if (leg.begin_s >= times.high) break;
      travel +=
          (std::min(leg.end_s, times.high) - std::max(leg.begin_s, times.low)) * leg.speed_mm_per_s;
    }
    return travel;
  }
  void Look(const Times& in_a, const Times& in_b, double slip_s) {
    if (in_a.low > in_b.high + slip_s || in_b.low > in_a.high + slip_s) return;
    const double travel_a = Travel(a_, in_a);
    const double travel_b = Travel(b_, in_b);
    const double t_a = in_a.middle();
    const double t_b = in_b.middle();
    const double distance =
        DistanceMm(ArmAt(arm_a_, LegAt(a_, t_a), t_a), ArmAt(arm_b_, LegAt(b_, t_b), t_b));
    if (distance - travel_a - travel_b >= best_.distance_mm - kTightToMm) return;
    if (distance < best_.distance_mm && std::abs(t_a - t_b) <= tolerance_.Slip(std::max(t_a, t_b)))
      best_ = {distance, std::max(0.0, (t_a + t_b) / 2)};
    if (travel_a + travel_b < kTightToMm) return;
    if (travel_a >= travel_b) {
      Look({in_a.low, t_a}, in_b, slip_s);
      Look({t_a, in_a.high}, in_b, slip_s);
    } else {
      Look(in_a, {in_b.low, t_b}, slip_s);
      Look(in_a, {t_b, in_b.high}, slip_s);
    }
  }

  const ArmGeometry& arm_a_;
  const ArmGeometry& arm_b_;
  const Track& a_;
  const Track& b_;
  Tolerance tolerance_;
  Nearest best_;
};

double NeedOf(const Scene& scene, std::uint32_t i, std::uint32_t j) {
  const auto near = scene.neighbours(i);
  const auto it =
      std::find_if(near.begin(), near.end(), [j](const NeighbourNeed& n) { return n.unit == j; });
  return it->need_mm;
}

}  // namespace

std::vector<TightPair> FindTightest(const Scene& scene, std::span<const Track> tracks,
                                    const Tolerance& tolerance, std::size_t count) {
  struct Pair {
    std::uint32_t i;
    std::uint32_t j;
    double seen_mm;  // clearance at some instant
  };
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    for (const NeighbourNeed& near : scene.neighbours(i)) {
      const std::uint32_t j = near.unit;
      if (j < i || tracks[i].legs().empty() || tracks[j].legs().empty()) continue;
      if (tracks[i].legs().size() == 1 && tracks[j].legs().size() == 1) continue;
      double nearest2 = 1e18;
      for (int n = -1; n <= std::max(tracks[i].slice_count(), tracks[j].slice_count()); ++n)
        nearest2 =
            std::min(nearest2, SquaredDistance(tracks[i].slice(n).line, tracks[j].slice(n).line));
      pairs.push_back({i, j, std::sqrt(nearest2) - scene.FullNeed(i, j)});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) {
    return x.seen_mm != y.seen_mm ? x.seen_mm < y.seen_mm
                                  : std::pair(x.i, x.j) < std::pair(y.i, y.j);
  });
  // Pairs that were seen near come first, so that most of the others need no more than one test.
  std::vector<TightPair> tightest;
  const auto nearer = [](const TightPair& x, const TightPair& y) {
    if (x.clearance_mm != y.clearance_mm) return x.clearance_mm < y.clearance_mm;
    return std::pair(x.a.value, x.b.value) < std::pair(y.a.value, y.b.value);
  };
  double limit_mm = count < pairs.size() ? pairs[count].seen_mm : 1e9;
  for (const Pair& pair : pairs) {
    const auto& [i, j, seen_mm] = pair;
    const double need_mm = scene.FullNeed(i, j);
    if (limit_mm < 1e8 && PassesClear(scene.arm(i), tracks[i], scene.arm(j), tracks[j],
                                      need_mm + limit_mm, tolerance))
      continue;
    const Nearest nearest =
        NearestApproach(scene.arm(i), tracks[i], scene.arm(j), tracks[j], tolerance)
            .Run(seen_mm + need_mm + kTightToMm);
    // The pair is proven clear by the planned need; the search stops short of the very least. A
    // pair that is led apart is not proven: it may start nearer.
    const bool proven = nearest.distance_mm >= NeedOf(scene, i, j) - kTightToMm;
    const double proven_mm = proven ? NeedOf(scene, i, j) - need_mm : -1e9;
    const double clearance_mm = std::max(proven_mm, nearest.distance_mm - kTightToMm - need_mm);
    tightest.push_back({{i}, {j}, clearance_mm, nearest.t_s});
    std::sort(tightest.begin(), tightest.end(), nearer);
    if (tightest.size() < count) continue;
    tightest.resize(count);
    limit_mm = std::min(limit_mm, tightest.back().clearance_mm);
  }
  return tightest;
}

std::optional<Following> FindFollowing(const FollowingQuestion& q) {
  constexpr double h = Track::kSliceS;
  constexpr int kGroup = Track::kSlicesPerBounds;
  const Track& mine = *q.ends;
  const Track& other = *q.comes;
  const double error = q.proven.clock_error;
  Tolerance plain = q.proven;
  plain.notice_s = 0;
  std::optional<Following> found;
  for (int n = std::max(0, static_cast<int>(q.from_s / h)); n < mine.slice_count(); ++n) {
    if (n % kGroup == 0) {
      // Nothing in this group of slices is met later: on to the next group.
      bool apart = true;
      for (int g = n / kGroup; g * kGroup <= other.slice_count() && apart; ++g)
        apart = Apart(mine.bounds(n / kGroup), other.bounds(g), q.need_mm);
      if (apart) {
        n += kGroup - 1;
        continue;
      }
    }
    const Slice& stands = mine.slice(n);
    // Times within the slip are proven clear already.
    const double after_s = n * h + q.proven.Slip(n * h);
    for (int m = static_cast<int>(after_s / h); m <= other.slice_count(); ++m) {
      const Slice& comes = other.slice(m);
      const double enough = q.need_mm + stands.travel_mm + comes.travel_mm;
      if (SquaredDistance(stands.line, comes.line) > enough * enough) continue;
      const double meets_s = std::max(m * h, after_s);
      const double begins_s = meets_s * (1 - error) - q.skew_s;
      if (!found)
        found = Following{.since_s = n * h * (1 - error) - q.skew_s,
                          .begins_s = begins_s,
                          .leaves_s = q.notice_s};
      found->begins_s = std::min(found->begins_s, begins_s);
      found->left_s = (n + 1) * h / (1 - error) + q.skew_s;
      // The proof holds for each instant of the slice, the distance of slices only for all of it.
      // The other unit may also be ahead by its clock when this one ends.
      const double ends_s = (n + 1) * h;
      const double seen_s = (m * h - ends_s - plain.Slip(ends_s)) / (1 + error);
      found->leaves_s = std::min(found->leaves_s, std::max(seen_s, q.proven.notice_s));
      break;
    }
  }
  return found;
}

void FindFollowers(const FollowersQuestion& question, Plan* plan) {
  const Scene& scene = *question.scene;
  Tolerance plain = question.tolerance;
  plain.notice_s = 0;
  plan->unnoticed.clear();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> crossing;
  for (UnitPlan& move : plan->moves) {
    move.followers.clear();
    const std::uint32_t i = move.unit.value;
    for (const NeighbourNeed& near : scene.neighbours(i)) {
      const Track& other = question.tracks[near.unit];
      if (other.legs().size() < 2) continue;
      const std::pair pair = std::minmax(i, near.unit);
      const bool excepted =
          std::binary_search(question.without_notice.begin(), question.without_notice.end(),
                             std::pair<std::uint32_t, std::uint32_t>(pair));
      const auto following = FindFollowing({.ends = &question.tracks[i],
                                            .comes = &other,
                                            .need_mm = near.need_mm,
                                            .proven = excepted ? plain : question.tolerance,
                                            .skew_s = plain.start_skew_s,
                                            .notice_s = question.notice_s});
      if (!following) continue;
      crossing.push_back(pair);
      move.followers.push_back(following->FollowerOf({near.unit}));
      if (following->leaves_s < question.notice_s)
        plan->unnoticed.push_back({{i}, {near.unit}, following->since_s, following->leaves_s});
    }
  }
  std::sort(crossing.begin(), crossing.end());
  plan->crossings =
      static_cast<std::uint32_t>(std::unique(crossing.begin(), crossing.end()) - crossing.begin());
}

}  // namespace focalfleet
