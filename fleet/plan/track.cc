#include "fleet/plan/track.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <new>
#include <type_traits>

namespace focalfleet {
namespace {

/// Two cells count as one pose below this distance, in mm: a pair that is closer than this to
/// touching is "not clear".
constexpr double kTrackResolutionMm = 2e-5;
constexpr std::size_t kTrackStackSize = 128;

struct Span1 {
  double low = 0;
  double high = 0;
  [[nodiscard]] double middle() const { return (low + high) / 2; }
  [[nodiscard]] double half() const { return (high - low) / 2; }
};

/// Own times of both units, a part of the band |a - b| <= slip, and where the arms are in the
/// middle of them.
struct PairCell {
  Span1 a;
  Span1 b;
  SegmentFp line_a;
  SegmentFp line_b;
};

/// Room for cells that is not cleared beforehand: most pairs need one or two of them.
template <class T>
class Stack {
 public:
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool HasRoomForTwo() const { return size_ + 2 <= kTrackStackSize; }
  void Push(const T& value) { new (&room_[sizeof(T) * size_++]) T(value); }
  T Pop() { return *std::launder(reinterpret_cast<const T*>(&room_[sizeof(T) * --size_])); }

 private:
  static_assert(std::is_trivially_destructible_v<T>);
  alignas(T) std::byte room_[sizeof(T) * kTrackStackSize];  // NOLINT: uninitialised on purpose
  std::size_t size_ = 0;
};

struct Mover {
  const ArmGeometry* arm;
  const Leg* leg;
};

bool LegsClear(const Mover& a, const Mover& b, const Span1& span_a, const Span1& span_b,
               double slip_s, double need_mm, int* budget) {
  // No point of an arm is farther from its middle than half its length.
  const double halves = (a.arm->phi_arm_mm() + b.arm->phi_arm_mm()) / 2;
  const auto at = [](const Mover& mover, const Span1& span) {
    return ArmAt(*mover.arm, *mover.leg, span.middle());
  };
  Stack<PairCell> stack;
  stack.Push({span_a, span_b, at(a, span_a), at(b, span_b)});
  while (!stack.empty()) {
    const PairCell whole = stack.Pop();
    const double travel_a = a.leg->speed_mm_per_s * whole.a.half();
    const double travel_b = b.leg->speed_mm_per_s * whole.b.half();
    const double enough = need_mm + travel_a + travel_b;
    if (SquaredDistanceOfMiddles(whole.line_a, whole.line_b) >
        (enough + halves) * (enough + halves))
      continue;
    const double distance2 = SquaredDistance(whole.line_a, whole.line_b);
    if (distance2 > enough * enough) continue;
    if (distance2 <= need_mm * need_mm) {
      // A unit that stands is there whenever the other comes; else the two middles must be able to
      // meet.
      double at_a = whole.a.middle();
      double at_b = whole.b.middle();
      if (a.leg->stands()) at_a = std::clamp(at_b, whole.a.low, whole.a.high);
      if (b.leg->stands()) at_b = std::clamp(at_a, whole.b.low, whole.b.high);
      if (std::abs(at_a - at_b) <= slip_s) return false;
    }
    if (travel_a + travel_b < kTrackResolutionMm || --*budget < 0 || !stack.HasRoomForTwo())
      return false;
    const bool halve_a = travel_a >= travel_b;
    const double middle = halve_a ? whole.a.middle() : whole.b.middle();
    for (const bool upper : {false, true}) {
      PairCell half = whole;
      Span1& cut = halve_a ? half.a : half.b;
      (upper ? cut.low : cut.high) = middle;
      if (half.a.low > half.b.high + slip_s || half.b.low > half.a.high + slip_s) continue;
      if (halve_a)
        half.line_a = at(a, half.a);
      else
        half.line_b = at(b, half.b);
      stack.Push(half);
    }
  }
  return true;
}

}  // namespace

std::uint32_t BeginTicks(const AxisPaths& paths) {
  std::uint32_t begin = std::numeric_limits<std::uint32_t>::max();
  for (const AxisPath& axis : paths)
    if (axis.size() > 0) begin = std::min(begin, axis.segments().front().start_ticks);
  return begin;
}

AxisPaths Shifted(const AxisPaths& paths, std::int64_t by_ticks) {
  AxisPaths shifted;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (Segment segment : paths[k].segments()) {
      segment.start_ticks = static_cast<std::uint32_t>(segment.start_ticks + by_ticks);
      shifted[k].Append(segment);
    }
  }
  return shifted;
}

Track::Track(const ArmGeometry& arm, const Pose& stands) {
  Stand(arm, stands);
  Cut(arm);
}

/// The unit stands in one leg that never ends.
void Track::Stand(const ArmGeometry& arm, const Pose& pose) {
  Leg leg;
  leg.begin_s = -kForever;
  leg.end_s = kForever;
  leg.theta_rad = arm.Theta(pose[0]);
  leg.fold_rad = arm.Fold(pose[1]);
  legs_.push_back(leg);
  reach_mm_ = std::max(arm.theta_arm_mm(), arm.FibreRadiusMax(pose[1], pose[1]));
}

/// Cuts the legs into slices and finds the bounds of these.
void Track::Cut(const ArmGeometry& arm) {
  const int count = std::max(0, static_cast<int>(std::ceil(end_s() / kSliceS)));
  slices_.clear();
  slices_.reserve(static_cast<std::size_t>(count) + 2);
  slices_.push_back({ArmAt(arm, legs_.front(), 0), 0});
  std::size_t at = 0;
  for (int n = 0; n < count; ++n) {
    const double begin_s = n * kSliceS;
    const double middle_s = begin_s + kSliceS / 2;
    const double end_s = begin_s + kSliceS;
    while (legs_[at].end_s <= begin_s) ++at;
    double before_mm = 0;
    double after_mm = 0;
    std::size_t middle = at;
    for (std::size_t k = at; k < legs_.size() && legs_[k].begin_s < end_s; ++k) {
      const Leg& leg = legs_[k];
      if (leg.begin_s <= middle_s) middle = k;
      if (leg.stands()) continue;
      const double from_s = std::max(leg.begin_s, begin_s);
      const double to_s = std::min(leg.end_s, end_s);
      before_mm += std::max(0.0, std::min(to_s, middle_s) - from_s) * leg.speed_mm_per_s;
      after_mm += std::max(0.0, to_s - std::max(from_s, middle_s)) * leg.speed_mm_per_s;
    }
    const double travel_mm = std::max(before_mm, after_mm);
    if (travel_mm == 0 && slices_.back().travel_mm == 0)
      slices_.push_back(slices_.back());
    else
      slices_.push_back({ArmAt(arm, legs_[middle], middle_s), travel_mm});
  }
  slices_.push_back({ArmAt(arm, legs_.back(), end_s()), 0});
  const auto cover = [&](int first, int last) {
    Bounds box{1e18, -1e18, 1e18, -1e18};
    for (int n = first; n <= last; ++n) {
      const Slice& s = slice(n);
      box.x_low = std::min(box.x_low, std::min(s.line.a.x_mm, s.line.b.x_mm) - s.travel_mm);
      box.x_high = std::max(box.x_high, std::max(s.line.a.x_mm, s.line.b.x_mm) + s.travel_mm);
      box.y_low = std::min(box.y_low, std::min(s.line.a.y_mm, s.line.b.y_mm) - s.travel_mm);
      box.y_high = std::max(box.y_high, std::max(s.line.a.y_mm, s.line.b.y_mm) + s.travel_mm);
    }
    return box;
  };
  bounds_.clear();
  bounds_.push_back(cover(-1, -1));
  for (int n = 0; n < count; n += kSlicesPerBounds)
    bounds_.push_back(cover(n, n + kSlicesPerBounds - 1));
  bounds_.push_back(cover(count, count));
}

Track::Track(const ArmGeometry& arm, const UnitDrive& drive, const Pose& from,
             const AxisPaths& path) {
  Stand(arm, from);
  struct Run {  // of one axis, in order
    double begin_s;
    double end_s;
    double rad_per_s;
  };
  std::array<std::array<Run, limits::kSegmentsPerAxis>, kAxisCount> runs;
  std::array<double, 4 * limits::kSegmentsPerAxis> knots;
  std::size_t knot_count = 0;
  for (const Axis axis : kAxes) {
    const std::size_t k = Index(axis);
    std::size_t r = 0;
    for (const Segment& segment : path[k].segments()) {
      const double begin_s = segment.start_ticks * 1e-4;
      const double lasts_s = std::abs(segment.delta) *
                             (segment.repeat * static_cast<double>(drive.axis[k].counter1)) /
                             kTimerHz;
      runs[k][r++] = {begin_s, begin_s + lasts_s, segment.delta * arm.step_rad(axis) / lasts_s};
      knots[knot_count++] = begin_s;
      knots[knot_count++] = begin_s + lasts_s;
    }
  }
  if (knot_count == 0) {
    Cut(arm);
    return;
  }
  legs_.reserve(knot_count + 1);
  std::sort(knots.begin(), knots.begin() + knot_count);
  legs_.front().end_s = knots[0];
  std::array<std::size_t, kAxisCount> next{};
  for (std::size_t n = 0; n < knot_count; ++n) {
    const Leg& before = legs_.back();
    Leg leg;
    leg.begin_s = knots[n];
    leg.end_s = n + 1 < knot_count ? knots[n + 1] : kForever;
    if (leg.end_s - leg.begin_s <= 0) continue;
    const double dt_s = before.stands() ? 0 : leg.begin_s - before.begin_s;
    leg.theta_rad = before.theta_rad + before.theta_rad_per_s * dt_s;
    leg.fold_rad = before.fold_rad + before.fold_rad_per_s * dt_s;
    std::array<double, kAxisCount> rate{};
    const double middle_s = (leg.begin_s + leg.end_s) / 2;
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      while (next[k] < path[k].size() && runs[k][next[k]].end_s <= leg.begin_s) ++next[k];
      if (next[k] < path[k].size() && runs[k][next[k]].begin_s <= middle_s)
        rate[k] = runs[k][next[k]].rad_per_s;
    }
    leg.theta_rad_per_s = rate[0];
    leg.fold_rad_per_s = rate[1];
    const double fold_end = leg.fold_rad + rate[1] * (leg.end_s - leg.begin_s);
    const double radius = std::max(
        arm.theta_arm_mm(),
        arm.FibreRadiusMaxFold(std::min(leg.fold_rad, fold_end), std::max(leg.fold_rad, fold_end)));
    reach_mm_ = std::max(reach_mm_, radius);
    leg.speed_mm_per_s = radius * std::abs(rate[0]) + arm.phi_arm_mm() * std::abs(rate[1]);
    legs_.push_back(leg);
  }
  Cut(arm);
}

namespace {

/// True: the leg `a` within `span_a` of its own time is clear of the legs of `b` within `time_b`.
bool LegClearOfPart(const Mover& a, const Span1& span_a, const ArmGeometry& arm_b, const Track& b,
                    const Span1& time_b, double slip_s, double need_mm, int* budget) {
  for (const Leg& leg_b : b.legs()) {
    const Span1 span_b{std::max(leg_b.begin_s, time_b.low), std::min(leg_b.end_s, time_b.high)};
    if (span_b.low > span_b.high) continue;
    const Span1 meet_a{std::max(span_a.low, span_b.low - slip_s),
                       std::min(span_a.high, span_b.high + slip_s)};
    const Span1 meet_b{std::max(span_b.low, span_a.low - slip_s),
                       std::min(span_b.high, span_a.high + slip_s)};
    if (meet_a.low > meet_a.high || meet_b.low > meet_b.high) continue;
    if (!LegsClear(a, {&arm_b, &leg_b}, meet_a, meet_b, slip_s, need_mm, budget)) return false;
  }
  return true;
}

/// True: the legs of both within these own times are clear of each other.
bool PartsClear(const ArmGeometry& arm_a, const Track& a, const Span1& time_a,
                const ArmGeometry& arm_b, const Track& b, const Span1& time_b, double slip_s,
                double need_mm, int* budget) {
  for (const Leg& leg_a : a.legs()) {
    const Span1 span_a{std::max(leg_a.begin_s, time_a.low), std::min(leg_a.end_s, time_a.high)};
    if (span_a.low > span_a.high) continue;
    if (!LegClearOfPart({&arm_a, &leg_a}, span_a, arm_b, b, time_b, slip_s, need_mm, budget))
      return false;
  }
  return true;
}

}  // namespace

bool PassesClearSince(double since_s, const ArmGeometry& arm_a, const Track& a,
                      const ArmGeometry& arm_b, const Track& b, double need_mm,
                      const Tolerance& tolerance, int budget) {
  const double reach = need_mm + a.reach_mm() + b.reach_mm();
  if (SquaredDistance(arm_a.base_fp(), arm_b.base_fp()) > reach * reach) return true;
  constexpr double h = Track::kSliceS;
  constexpr int kGroup = Track::kSlicesPerBounds;
  const double halves = (arm_a.phi_arm_mm() + arm_b.phi_arm_mm()) / 2;
  const int last = std::max(a.slice_count(), b.slice_count());
  const int first = since_s < 0 ? -1 : static_cast<int>(std::min<double>(since_s / h, last));
  for (int group = first < 0 ? -1 : first / kGroup; group * kGroup <= last; ++group) {
    const int first_n = std::max(group * kGroup, first);
    const int last_n = std::min(group * kGroup + kGroup - 1, last);
    if (first_n > last_n) continue;
    const double slip_s = tolerance.Slip((last_n + 1) * h + tolerance.Slip((last_n + 1) * h));
    const int reach_n = static_cast<int>(slip_s / h) + 1;
    bool apart = true;
    const int group_low = (first_n - reach_n + kGroup) / kGroup - 1;
    const int group_high = (last_n + reach_n) / kGroup;
    for (int g = group_low; g <= group_high && apart; ++g)
      apart = Apart(a.bounds(group), b.bounds(g), need_mm);
    if (apart) continue;
    for (int n = first_n; n <= last_n; ++n) {
      const Slice& slice_a = a.slice(n);
      for (int m = n - reach_n; m <= n + reach_n; ++m) {
        const Slice& slice_b = b.slice(m);
        const double enough = need_mm + slice_a.travel_mm + slice_b.travel_mm;
        if (SquaredDistanceOfMiddles(slice_a.line, slice_b.line) >
            (enough + halves) * (enough + halves))
          continue;
        const double distance2 = SquaredDistance(slice_a.line, slice_b.line);
        if (distance2 > enough * enough) continue;
        const bool meet = std::abs(n - m) * h <= slip_s;
        if (distance2 <= need_mm * need_mm && meet) return false;
        const auto time_of = [&](int k, const Track& track) {
          // The stands, as far as the other may meet them.
          return Span1{k < 0 ? -Track::kForever : k * h,
                       k >= track.slice_count() ? Track::kForever : (k + 1) * h};
        };
        Span1 time_a = time_of(n, a);
        time_a.low = std::max(time_a.low, since_s);
        if (!PartsClear(arm_a, a, time_a, arm_b, b, time_of(m, b), slip_s, need_mm, &budget))
          return false;
      }
    }
  }
  return true;
}

bool PassesClear(const ArmGeometry& arm_a, const Track& a, const ArmGeometry& arm_b, const Track& b,
                 double need_mm, const Tolerance& tolerance, int budget) {
  return PassesClearSince(-Track::kForever, arm_a, a, arm_b, b, need_mm, tolerance, budget);
}

bool LegPassesClear(const ArmGeometry& arm_a, const Leg& a, const ArmGeometry& arm_b,
                    const Track& b, double need_mm, const Tolerance& tolerance, int budget) {
  constexpr double h = Track::kSliceS;
  // A stand may last for ever; when the other stands too, nothing new can happen.
  const double last_s = a.stands() ? std::max(a.begin_s, b.end_s()) + h : a.end_s;
  const Span1 span_a{a.begin_s, std::min(a.end_s, last_s)};
  const double slip_s = tolerance.Slip(span_a.high + tolerance.Slip(span_a.high));
  const double middle_s = span_a.middle();
  const SegmentFp line = ArmAt(arm_a, a, middle_s);
  const double travel_a = a.speed_mm_per_s * span_a.half();
  const double halves = (arm_a.phi_arm_mm() + arm_b.phi_arm_mm()) / 2;
  // Beyond the end the unit stands: that is the last slice.
  const int first =
      std::min(static_cast<int>(std::floor((span_a.low - slip_s) / h)), b.slice_count());
  const int last =
      std::min(static_cast<int>(std::floor((span_a.high + slip_s) / h)), b.slice_count());
  // A certain meeting is found at once; only then is it worth to look closely at the rest.
  constexpr std::size_t kNearMax = 64;
  std::array<int, kNearMax> near;
  std::size_t near_count = 0;
  for (int m = std::max(first, -1); m <= last; ++m) {
    const Slice& slice = b.slice(m);
    const double enough = need_mm + travel_a + slice.travel_mm;
    if (SquaredDistanceOfMiddles(line, slice.line) > (enough + halves) * (enough + halves))
      continue;
    const double distance2 = SquaredDistance(line, slice.line);
    if (distance2 > enough * enough) continue;
    if (distance2 <= need_mm * need_mm && std::abs((m + 0.5) * h - middle_s) <= slip_s)
      return false;
    if (near_count == kNearMax) return false;
    near[near_count++] = m;
  }
  for (std::size_t n = 0; n < near_count; ++n) {
    const int m = near[n];
    const Span1 time_b{m < 0 ? -Track::kForever : m * h,
                       m >= b.slice_count() ? Track::kForever : (m + 1) * h};
    if (!LegClearOfPart({&arm_a, &a}, span_a, arm_b, b, time_b, slip_s, need_mm, &budget))
      return false;
  }
  return true;
}

bool LegPassesClearOf(const ArmGeometry& arm, const Leg& leg, const Capsule& standing,
                      double need_mm, int budget) {
  const double need = need_mm + standing.radius_mm;
  Stack<Span1> stack;
  stack.Push(leg.stands() ? Span1{leg.begin_s, leg.begin_s} : Span1{leg.begin_s, leg.end_s});
  while (!stack.empty()) {
    const Span1 span = stack.Pop();
    const double at = span.middle();
    const double travel = leg.speed_mm_per_s * span.half();
    const double distance2 = SquaredDistance(ArmAt(arm, leg, at), standing.line);
    if (distance2 > (need + travel) * (need + travel)) continue;
    if (distance2 <= need * need || travel < kTrackResolutionMm || --budget < 0 ||
        !stack.HasRoomForTwo())
      return false;
    stack.Push({span.low, at});
    stack.Push({at, span.high});
  }
  return true;
}

bool PassesClearOf(const ArmGeometry& arm, const Track& track, const Capsule& standing,
                   double need_mm, int budget) {
  const double reach = need_mm + standing.radius_mm + track.reach_mm();
  if (SquaredDistance(arm.base_fp(), standing.line) > reach * reach) return true;
  return std::all_of(track.legs().begin(), track.legs().end(), [&](const Leg& leg) {
    return LegPassesClearOf(arm, leg, standing, need_mm, budget);
  });
}

}  // namespace focalfleet
