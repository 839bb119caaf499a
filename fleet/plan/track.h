// The place of a unit's arm over its own time: legs, linear in both angles, with a stand before the
// first and after the last. Times are seconds after the start signal by the unit's own clock, made
// from the very segments that go on the bus.
//
// Two clocks never agree: a unit starts up to `start_skew_s` early or late and its clock runs up to
// `clock_error` fast or slow. Own times a and b of two units can therefore belong to one true
// instant exactly if |a - b| <= Slip(max(a, b)). A test of all such (a, b) holds for every skew and
// clock.
//
// `notice_s` keeps each unit clear of where the other was up to that long before as well. A unit
// that halts by itself is then no danger if the other is stopped that much later.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/geometry/arm.h"
#include "protocol/wire/staged_move.h"

namespace focalfleet {

struct Tolerance {
  double start_skew_s = 0.020;
  double clock_error = 0.005;
  double notice_s = 0;

  /// The most that the own times of two units may differ at one instant, by `t_s`. Units: s.
  [[nodiscard]] double Slip(double t_s) const {
    // (1 + e) / (1 - e) - 1 is below 2 e / (1 - e).
    return ((2 * start_skew_s + notice_s) * (1 + clock_error) + kVectorS) +
           2 * clock_error / (1 - clock_error) * std::max(t_s, 0.0);
  }
  static constexpr double kVectorS = 1e-3;  // within a vector the place of the rotor is not known
};

/// Leg of a motion: angles at `begin_s` and their rates.
struct Leg {
  double begin_s = 0;
  double end_s = 0;
  double theta_rad = 0;
  double fold_rad = 0;
  double theta_rad_per_s = 0;
  double fold_rad_per_s = 0;
  double speed_mm_per_s = 0;  // no point of the arm is faster
  [[nodiscard]] bool stands() const { return speed_mm_per_s == 0; }
};

/// Where an arm is during one slice of its own time: no farther than `travel_mm` from `line`.
struct Slice {
  SegmentFp line;
  double travel_mm = 0;
};
/// The rectangle that the arm covers during some slices, without its half-width.
struct Bounds {
  double x_low = 0;
  double x_high = 0;
  double y_low = 0;
  double y_high = 0;
};

inline bool Apart(const Bounds& a, const Bounds& b, double need_mm) {
  return a.x_low > b.x_high + need_mm || b.x_low > a.x_high + need_mm ||
         a.y_low > b.y_high + need_mm || b.y_low > a.y_high + need_mm;
}

using AxisPaths = std::array<AxisPath, kAxisCount>;

/// The unit stands.
inline bool IsEmpty(const AxisPaths& paths) { return paths[0].size() + paths[1].size() == 0; }
/// When the first segment begins; the largest number for an empty motion. Units: ticks of 100 us.
std::uint32_t BeginTicks(const AxisPaths& paths);
/// The same motion later by so many ticks of 100 us; sooner, where that is negative. Pre: no
/// segment begins before 0 then.
AxisPaths Shifted(const AxisPaths& paths, std::int64_t by_ticks);

class Track {
 public:
  Track() = default;
  /// A unit that stands where it is.
  Track(const ArmGeometry& arm, const Pose& stands);
  Track(const ArmGeometry& arm, const UnitDrive& drive, const Pose& from, const AxisPaths& path);

  /// Shape: at least one; the first begins at -kForever, the last ends at kForever.
  [[nodiscard]] std::span<const Leg> legs() const { return legs_; }
  [[nodiscard]] bool moves() const { return legs_.size() > 1; }
  [[nodiscard]] double end_s() const { return legs_.back().begin_s; }
  /// Farthest that any point of the arm's core gets from the base. Units: mm.
  [[nodiscard]] double reach_mm() const { return reach_mm_; }

  static constexpr double kForever = 1e9;
  static constexpr double kSliceS = 0.5;      // of the unit's own time
  static constexpr int kSlicesPerBounds = 8;  // slices that one rectangle covers

  /// The slice from n * kSliceS on; below 0 and beyond the end: where it stands then.
  [[nodiscard]] const Slice& slice(int n) const {
    return slices_[static_cast<std::size_t>(std::clamp(n + 1, 0, slice_count() + 1))];
  }
  [[nodiscard]] int slice_count() const { return static_cast<int>(slices_.size()) - 2; }
  /// The bounds of slices n * kSlicesPerBounds and those that follow; beyond either end, of the
  /// stand there.
  [[nodiscard]] const Bounds& bounds(int n) const {
    return bounds_[static_cast<std::size_t>(
        std::clamp(n + 1, 0, static_cast<int>(bounds_.size()) - 1))];
  }

 private:
  void Stand(const ArmGeometry& arm, const Pose& pose);
  void Cut(const ArmGeometry& arm);

  std::vector<Leg> legs_;
  std::vector<Slice> slices_;
  std::vector<Bounds> bounds_;
  double reach_mm_ = 0;
};

/// Where one arm is at a time of a leg.
inline SegmentFp ArmAt(const ArmGeometry& arm, const Leg& leg, double own_s) {
  const double dt_s = leg.stands() ? 0 : own_s - leg.begin_s;
  return arm.AtAngles(leg.theta_rad + leg.theta_rad_per_s * dt_s,
                      leg.fold_rad + leg.fold_rad_per_s * dt_s);
}

/// True: the two are farther apart than `need_mm` at all own times that the tolerance lets meet.
/// Nothing is sampled. Cost: at most `budget` distances. More would be needed only where they
/// nearly touch; the answer is then false.
bool PassesClear(const ArmGeometry& arm_a, const Track& a, const ArmGeometry& arm_b, const Track& b,
                 double need_mm, const Tolerance& tolerance, int budget = 2000);

/// The same for `a` from `since_s` of its own time on: where it was before does not count.
bool PassesClearSince(double since_s, const ArmGeometry& arm_a, const Track& a,
                      const ArmGeometry& arm_b, const Track& b, double need_mm,
                      const Tolerance& tolerance, int budget = 2000);

/// The same for one leg of `a`; times before and after it do not count.
bool LegPassesClear(const ArmGeometry& arm_a, const Leg& a, const ArmGeometry& arm_b,
                    const Track& b, double need_mm, const Tolerance& tolerance, int budget = 500);

/// The same against something that never moves.
bool LegPassesClearOf(const ArmGeometry& arm, const Leg& leg, const Capsule& standing,
                      double need_mm, int budget = 500);
bool PassesClearOf(const ArmGeometry& arm, const Track& track, const Capsule& standing,
                   double need_mm, int budget = 2000);

}  // namespace focalfleet
