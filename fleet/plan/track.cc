#include "fleet/plan/track.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <new>
#include <type_traits>

namespace focalfleet {
namespace {

/// Below this two cells count as one pose: closer than this to touching is "not clear".
constexpr double kResolutionMm = 2e-5;
constexpr std::size_t kStackSize = 128;

struct Span1 {
  double low = 0;
  double high = 0;
  [[nodiscard]] double middle() const { return (low + high) / 2; }
  [[nodiscard]] double half() const { return (high - low) / 2; }
};

/// Own times of both, a part of the band |a - b| <= slip, and where the arms are in their middles.
struct Cell {
  Span1 a;
  Span1 b;
  SegmentFp line_a;
  SegmentFp line_b;
};

/// Room for cells that nobody clears beforehand: most pairs need one or two of them.
template <class T>
class Stack {
 public:
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool HasRoomForTwo() const { return size_ + 2 <= kStackSize; }
  void Push(const T& value) { new (&room_[sizeof(T) * size_++]) T(value); }
  T Pop() { return *std::launder(reinterpret_cast<const T*>(&room_[sizeof(T) * --size_])); }

 private:
  static_assert(std::is_trivially_destructible_v<T>);
  alignas(T) std::byte room_[sizeof(T) * kStackSize];  // NOLINT: uninitialised on purpose
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
  Stack<Cell> stack;
  stack.Push({span_a, span_b, at(a, span_a), at(b, span_b)});
  while (!stack.empty()) {
    const Cell whole = stack.Pop();
    const double travel_a = a.leg->speed_mm_per_s * whole.a.half();
    const double travel_b = b.leg->speed_mm_per_s * whole.b.half();
    const double enough = need_mm + travel_a + travel_b;
    if (SquaredDistanceOfMiddles(whole.line_a, whole.line_b) >
        (enough + halves) * (enough + halves))
      continue;
    const double distance2 = SquaredDistance(whole.line_a, whole.line_b);
    if (distance2 > enough * enough) continue;
    if (distance2 <= need_mm * need_mm) {
      // One that stands is there whenever the other comes; else the two middles must be able to
      // meet.
      double at_a = whole.a.middle();
      double at_b = whole.b.middle();
      if (a.leg->stands()) at_a = std::clamp(at_b, whole.a.low, whole.a.high);
      if (b.leg->stands()) at_b = std::clamp(at_a, whole.b.low, whole.b.high);
      if (std::abs(at_a - at_b) <= slip_s) return false;
    }
    if (travel_a + travel_b < kResolutionMm || --*budget < 0 || !stack.HasRoomForTwo())
      return false;
    const bool halve_a = travel_a >= travel_b;
    const double middle = halve_a ? whole.a.middle() : whole.b.middle();
    for (const bool upper : {false, true}) {
      Cell half = whole;
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

Track::Track(const ArmGeometry& arm, const Pose& stands) {
  Leg leg;
  leg.begin_s = -kForever;
  leg.end_s = kForever;
  leg.theta_rad = arm.Theta(stands[0]);
  leg.fold_rad = arm.Fold(stands[1]);
  legs_.push_back(leg);
  reach_mm_ = std::max(arm.theta_arm_mm(), arm.FibreRadiusMax(stands[1], stands[1]));
}

Track::Track(const ArmGeometry& arm, const UnitDrive& drive, const Pose& from,
             const AxisPaths& path)
    : Track(arm, from) {
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
  if (knot_count == 0) return;
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
}

bool PassesClear(const ArmGeometry& arm_a, const Track& a, const ArmGeometry& arm_b, const Track& b,
                 double need_mm, const Tolerance& tolerance, int budget) {
  const double reach = need_mm + a.reach_mm() + b.reach_mm();
  if (SquaredDistance(arm_a.base_fp(), arm_b.base_fp()) > reach * reach) return true;
  const double slip_last_s = tolerance.Slip(std::max(a.end_s(), b.end_s()));
  // Beyond these nothing new can be met.
  const double first_s = -slip_last_s;
  const double last_s = std::max({a.end_s(), b.end_s(), 0.0}) + slip_last_s;
  std::size_t from_b = 0;
  for (const Leg& leg_a : a.legs()) {
    const Span1 span_a{std::max(leg_a.begin_s, first_s), std::min(leg_a.end_s, last_s)};
    for (std::size_t n = from_b; n < b.legs().size(); ++n) {
      const Leg& leg_b = b.legs()[n];
      const Span1 span_b{std::max(leg_b.begin_s, first_s), std::min(leg_b.end_s, last_s)};
      if (span_b.high < span_a.low - slip_last_s) {
        from_b = n + 1;
        continue;
      }
      if (span_b.low > span_a.high + slip_last_s) break;
      const double slip_s = tolerance.Slip(std::min(span_a.high, span_b.high) + slip_last_s);
      const Span1 meet_a{std::max(span_a.low, span_b.low - slip_s),
                         std::min(span_a.high, span_b.high + slip_s)};
      const Span1 meet_b{std::max(span_b.low, span_a.low - slip_s),
                         std::min(span_b.high, span_a.high + slip_s)};
      if (meet_a.low > meet_a.high || meet_b.low > meet_b.high) continue;
      if (!LegsClear({&arm_a, &leg_a}, {&arm_b, &leg_b}, meet_a, meet_b, slip_s, need_mm, &budget))
        return false;
    }
  }
  return true;
}

bool LegPassesClear(const ArmGeometry& arm_a, const Leg& a, const ArmGeometry& arm_b,
                    const Track& b, double need_mm, const Tolerance& tolerance, int budget) {
  const double most_slip_s =
      tolerance.Slip(std::max(std::min(a.end_s, b.end_s()), a.begin_s)) * 1.1;
  const double last_s = std::max({a.begin_s, b.end_s(), 0.0}) + 2 * most_slip_s;
  const Span1 span_a{a.begin_s, std::min(a.end_s, last_s)};
  for (const Leg& leg_b : b.legs()) {
    const Span1 span_b{std::max(leg_b.begin_s, -most_slip_s), std::min(leg_b.end_s, last_s)};
    if (span_b.high < span_a.low - most_slip_s) continue;
    if (span_b.low > span_a.high + most_slip_s) break;
    const double slip_s = tolerance.Slip(std::min(span_a.high, span_b.high) + most_slip_s);
    const Span1 meet_a{std::max(span_a.low, span_b.low - slip_s),
                       std::min(span_a.high, span_b.high + slip_s)};
    const Span1 meet_b{std::max(span_b.low, span_a.low - slip_s),
                       std::min(span_b.high, span_a.high + slip_s)};
    if (meet_a.low > meet_a.high || meet_b.low > meet_b.high) continue;
    if (!LegsClear({&arm_a, &a}, {&arm_b, &leg_b}, meet_a, meet_b, slip_s, need_mm, &budget))
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
    if (distance2 <= need * need || travel < kResolutionMm || --budget < 0 ||
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
