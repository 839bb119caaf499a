#include "fleet/geometry/arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "fleet/kinematics.h"
#include "protocol/base/units.h"

namespace focalfleet {
namespace {

/// A part of a sweep: middle and half-widths in radians. While `half_along` is not 0 it is the part
/// of a band around the fraction `along` and is halved there. Once that is shorter than the band is
/// wide it is a box, and its wider side is halved.
struct Cell {
  double theta = 0;
  double fold = 0;
  double half_theta = 0;
  double half_fold = 0;
  double along = 0;
  double half_along = 0;
};

struct CellPlace {
  SegmentFp line;          // the arm in the middle of the cell
  double by_theta_mm = 0;  // how far any point of the arm gets from there because of theta
  double by_phi_mm = 0;    // and because of phi
  [[nodiscard]] double travel_mm() const { return by_theta_mm + by_phi_mm; }
  [[nodiscard]] double largest_mm() const { return std::max(by_theta_mm, by_phi_mm); }
};

/// Boxes below this size count as one pose: closer than this to touching is "not clear".
constexpr double kResolutionMm = 2e-5;
constexpr std::size_t kStackSize = 160;  // four halvings of 40 bits each are more than int32 has

}  // namespace

ArmGeometry::ArmGeometry(const Unit& unit, const UnitDrive& drive)
    : base_(unit.base_fp),
      theta_arm_mm_(unit.theta().arm_mm),
      phi_arm_mm_(unit.phi().arm_mm),
      half_width_mm_(unit.arm_half_width_mm),
      theta_zero_rad_(unit.theta().zero_deg * kRadiansPerDegree),
      phi_zero_rad_(unit.phi().zero_deg * kRadiansPerDegree) {
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const VectorRange range = RangeOf(unit.axis[k], drive.axis[k]);
    range_.low[k] = range.low;
    range_.high[k] = range.high;
  }
  theta_step_rad_ = DegreesPerVector(unit.axis[0], drive.axis[0]) * kRadiansPerDegree;
  phi_step_rad_ = DegreesPerVector(unit.axis[1], drive.axis[1]) * kRadiansPerDegree;
}

SegmentFp ArmGeometry::At(const Pose& pose) const {
  return AtAngles(Theta(pose[0]), Fold(pose[1]));
}

double ArmGeometry::FibreRadiusMaxFold(double low, double high) const {
  const double turn = 2 * std::numbers::pi;
  double cosine = std::max(std::cos(low), std::cos(high));
  if (std::ceil(low / turn) * turn <= high) cosine = 1;
  return std::sqrt(theta_arm_mm_ * theta_arm_mm_ + phi_arm_mm_ * phi_arm_mm_ +
                   2 * theta_arm_mm_ * phi_arm_mm_ * cosine);
}

class SweepTest {
 public:
  class Mover;
  SweepTest(double need_mm, int budget) : need_mm_(need_mm), budget_(budget) {}
  bool BothClear(const Mover& a, const Mover& b);
  bool ClearOf(const Mover& a, const SegmentFp& standing);

 private:
  struct Pair {
    Cell a;
    Cell b;
    CellPlace place_a;
    CellPlace place_b;
  };
  enum class Verdict { kClear, kTouch, kAskAgain };

  Verdict Judge(double distance_squared, double travel_mm) {
    const double enough = need_mm_ + travel_mm;
    if (distance_squared > enough * enough) return Verdict::kClear;
    if (distance_squared <= need_mm_ * need_mm_) return Verdict::kTouch;
    return travel_mm < kResolutionMm || --budget_ < 0 ? Verdict::kTouch : Verdict::kAskAgain;
  }

  Verdict Judge(const Pair& pair) {
    return Judge(SquaredDistance(pair.place_a.line, pair.place_b.line),
                 pair.place_a.travel_mm() + pair.place_b.travel_mm());
  }

  double need_mm_;
  int budget_;
};

/// An arm and its sweep, cut into cells on demand.
class SweepTest::Mover {
 public:
  Mover(const ArmGeometry& arm, const Sweep& sweep)
      : arm_(arm),
        theta_(arm.theta_zero_rad_ + sweep.from[0] * arm.theta_step_rad_),
        fold_(arm.Fold(sweep.from[1])),
        theta_way_((static_cast<double>(sweep.to[0]) - sweep.from[0]) * arm.theta_step_rad_),
        fold_way_((static_cast<double>(sweep.to[1]) - sweep.from[1]) * arm.phi_step_rad_),
        half_band_(sweep.out_of_step / 2) {}

  [[nodiscard]] Cell Whole() const { return PartOf(0.5, 0.5); }

  [[nodiscard]] std::pair<Cell, Cell> Halves(const Cell& cell, const CellPlace& place) const {
    if (cell.half_along > 0) {
      const double quarter = cell.half_along / 2;
      return {PartOf(cell.along - quarter, quarter), PartOf(cell.along + quarter, quarter)};
    }
    Cell lower = cell;
    Cell upper = cell;
    if (place.by_theta_mm >= place.by_phi_mm) {
      lower.half_theta = upper.half_theta = cell.half_theta / 2;
      lower.theta -= lower.half_theta;
      upper.theta += upper.half_theta;
    } else {
      lower.half_fold = upper.half_fold = cell.half_fold / 2;
      lower.fold -= lower.half_fold;
      upper.fold += upper.half_fold;
    }
    return {lower, upper};
  }

  [[nodiscard]] CellPlace Place(const Cell& cell) const {
    CellPlace place;
    const double beyond = cell.theta + cell.fold;
    const double ex = arm_.theta_arm_mm_ * std::cos(cell.theta);
    const double ey = arm_.theta_arm_mm_ * std::sin(cell.theta);
    const double fx = ex + arm_.phi_arm_mm_ * std::cos(beyond);
    const double fy = ey + arm_.phi_arm_mm_ * std::sin(beyond);
    const PointFp& base = arm_.base_;
    place.line = {{base.x_mm + ex, base.y_mm + ey}, {base.x_mm + fx, base.y_mm + fy}};
    place.by_phi_mm = arm_.phi_arm_mm_ * cell.half_fold;
    const double radius =
        std::max(arm_.theta_arm_mm_, std::sqrt(fx * fx + fy * fy) + place.by_phi_mm);
    place.by_theta_mm = radius * cell.half_theta;
    return place;
  }

 private:
  [[nodiscard]] Cell PartOf(double along, double half) const {
    const double low = std::max(0.0, along - half - half_band_);
    const double high = std::min(1.0, along + half + half_band_);
    const double middle = (low + high) / 2;
    const double half_width = (high - low) / 2;
    return {theta_ + middle * theta_way_,
            fold_ + middle * fold_way_,
            half_width * std::abs(theta_way_),
            half_width * std::abs(fold_way_),
            along,
            half > half_band_ ? half : 0};
  }

  const ArmGeometry& arm_;
  double theta_;
  double fold_;
  double theta_way_;
  double fold_way_;
  double half_band_;
};

bool SweepTest::BothClear(const Mover& a, const Mover& b) {
  const Cell whole_a = a.Whole();
  const Cell whole_b = b.Whole();
  const Pair whole{whole_a, whole_b, a.Place(whole_a), b.Place(whole_b)};
  // Most pairs are far apart: they do not pay for the stack.
  if (Judge(whole) == Verdict::kClear) return true;
  std::array<Pair, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = whole;
  while (size > 0) {
    const Pair pair = stack[--size];
    const Verdict verdict = Judge(pair);
    if (verdict == Verdict::kClear) continue;
    if (verdict == Verdict::kTouch || size + 2 > kStackSize) return false;
    if (pair.place_a.largest_mm() >= pair.place_b.largest_mm()) {
      const auto [lower, upper] = a.Halves(pair.a, pair.place_a);
      stack[size++] = {lower, pair.b, a.Place(lower), pair.place_b};
      stack[size++] = {upper, pair.b, a.Place(upper), pair.place_b};
    } else {
      const auto [lower, upper] = b.Halves(pair.b, pair.place_b);
      stack[size++] = {pair.a, lower, pair.place_a, b.Place(lower)};
      stack[size++] = {pair.a, upper, pair.place_a, b.Place(upper)};
    }
  }
  return true;
}

bool SweepTest::ClearOf(const Mover& a, const SegmentFp& standing) {
  const Cell whole = a.Whole();
  const CellPlace whole_place = a.Place(whole);
  if (Judge(SquaredDistance(whole_place.line, standing), whole_place.travel_mm()) ==
      Verdict::kClear)
    return true;
  std::array<Cell, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = whole;
  while (size > 0) {
    const Cell cell = stack[--size];
    const CellPlace place = a.Place(cell);
    const Verdict verdict = Judge(SquaredDistance(place.line, standing), place.travel_mm());
    if (verdict == Verdict::kClear) continue;
    if (verdict == Verdict::kTouch || size + 2 > kStackSize) return false;
    const auto [lower, upper] = a.Halves(cell, place);
    stack[size++] = lower;
    stack[size++] = upper;
  }
  return true;
}

bool SweepsClear(const ArmGeometry& a, const Sweep& sweep_a, const ArmGeometry& b,
                 const Sweep& sweep_b, double need_mm, int budget) {
  const auto radius = [](const ArmGeometry& arm, const PoseBox& box) {
    return std::max(arm.theta_arm_mm(), arm.FibreRadiusMax(box.low[1], box.high[1]));
  };
  const double reach = need_mm + radius(a, sweep_a.box()) + radius(b, sweep_b.box());
  if (SquaredDistance(a.base_fp(), b.base_fp()) > reach * reach) return true;
  return SweepTest(need_mm, budget).BothClear({a, sweep_a}, {b, sweep_b});
}

bool SweepClearOf(const ArmGeometry& a, const Sweep& sweep, const Capsule& standing, double need_mm,
                  int budget) {
  return SweepTest(need_mm + standing.radius_mm, budget).ClearOf({a, sweep}, standing.line);
}

}  // namespace focalfleet
