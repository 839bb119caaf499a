#include "fleet/geometry/arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

/// A box of poses as middle and half-widths, in radians.
struct Cell {
  double theta = 0;
  double fold = 0;
  double half_theta = 0;
  double half_fold = 0;
};

struct CellPlace {
  SegmentFp line;
  double by_theta_mm =
      0;  // how far any point of the arm gets from `line` because of theta, and of phi
  double by_phi_mm = 0;
  [[nodiscard]] double travel_mm() const { return by_theta_mm + by_phi_mm; }
};

/// Below this the boxes count as one pose: closer than this to touching is "not clear".
constexpr double kResolution_mm = 2e-5;
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
  const double theta = theta_zero_rad_ + pose[0] * theta_step_rad_;
  const double beyond = theta + Fold(pose[1]);
  SegmentFp line;
  line.a.x_mm = base_.x_mm + theta_arm_mm_ * std::cos(theta);
  line.a.y_mm = base_.y_mm + theta_arm_mm_ * std::sin(theta);
  line.b.x_mm = line.a.x_mm + phi_arm_mm_ * std::cos(beyond);
  line.b.y_mm = line.a.y_mm + phi_arm_mm_ * std::sin(beyond);
  return line;
}

double ArmGeometry::FibreRadiusMax(std::int32_t phi_low, std::int32_t phi_high) const {
  const double low = Fold(phi_low);
  const double high = Fold(phi_high);
  const double turn = 2 * std::numbers::pi;
  double cosine = std::max(std::cos(low), std::cos(high));
  if (std::ceil(low / turn) * turn <= high) cosine = 1;
  return std::sqrt(theta_arm_mm_ * theta_arm_mm_ + phi_arm_mm_ * phi_arm_mm_ +
                   2 * theta_arm_mm_ * phi_arm_mm_ * cosine);
}

class SweepTest {
 public:
  SweepTest(double need_mm, int budget) : need_mm_(need_mm), budget_(budget) {}

  bool BothClear(const ArmGeometry& a, const PoseBox& box_a, const ArmGeometry& b,
                 const PoseBox& box_b) {
    std::array<Pair, kStackSize> stack;
    std::size_t size = 0;
    Pair first{MiddleOf(a, box_a), MiddleOf(b, box_b), {}, {}};
    first.place_a = Place(a, first.a);
    first.place_b = Place(b, first.b);
    stack[size++] = first;
    while (size > 0) {
      Pair pair = stack[--size];
      const double travel = pair.place_a.travel_mm() + pair.place_b.travel_mm();
      switch (Judge(SquaredDistance(pair.place_a.line, pair.place_b.line), travel)) {
        case Verdict::kClear:
          continue;
        case Verdict::kTouch:
          return false;
        case Verdict::kAskAgain:
          break;
      }
      if (size + 2 > kStackSize) return false;
      const bool split_a = Largest(pair.place_a) >= Largest(pair.place_b);
      const ArmGeometry& arm = split_a ? a : b;
      const auto [lower, upper] =
          Halves(split_a ? pair.a : pair.b, split_a ? pair.place_a : pair.place_b);
      for (const Cell& half : {lower, upper}) {
        Pair& next = stack[size++] = pair;
        (split_a ? next.a : next.b) = half;
        (split_a ? next.place_a : next.place_b) = Place(arm, half);
      }
    }
    return true;
  }

  bool ClearOf(const ArmGeometry& a, const PoseBox& box_a, const SegmentFp& standing) {
    std::array<Cell, kStackSize> stack;
    std::size_t size = 0;
    stack[size++] = MiddleOf(a, box_a);
    while (size > 0) {
      const Cell cell = stack[--size];
      const CellPlace place = Place(a, cell);
      switch (Judge(SquaredDistance(place.line, standing), place.travel_mm())) {
        case Verdict::kClear:
          continue;
        case Verdict::kTouch:
          return false;
        case Verdict::kAskAgain:
          break;
      }
      if (size + 2 > kStackSize) return false;
      const auto [lower, upper] = Halves(cell, place);
      stack[size++] = lower;
      stack[size++] = upper;
    }
    return true;
  }

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
    return travel_mm < kResolution_mm || --budget_ < 0 ? Verdict::kTouch : Verdict::kAskAgain;
  }

  static Cell MiddleOf(const ArmGeometry& arm, const PoseBox& box) {
    const double middle_theta = (static_cast<double>(box.low[0]) + box.high[0]) / 2;
    const double middle_phi = (static_cast<double>(box.low[1]) + box.high[1]) / 2;
    return {arm.theta_zero_rad_ + middle_theta * arm.theta_step_rad_,
            arm.phi_zero_rad_ + middle_phi * arm.phi_step_rad_,
            (static_cast<double>(box.high[0]) - box.low[0]) / 2 * arm.theta_step_rad_,
            (static_cast<double>(box.high[1]) - box.low[1]) / 2 * arm.phi_step_rad_};
  }

  static CellPlace Place(const ArmGeometry& arm, const Cell& cell) {
    CellPlace place;
    const double beyond = cell.theta + cell.fold;
    const double ex = arm.theta_arm_mm_ * std::cos(cell.theta);
    const double ey = arm.theta_arm_mm_ * std::sin(cell.theta);
    const double fx = ex + arm.phi_arm_mm_ * std::cos(beyond);
    const double fy = ey + arm.phi_arm_mm_ * std::sin(beyond);
    place.line = {{arm.base_.x_mm + ex, arm.base_.y_mm + ey},
                  {arm.base_.x_mm + fx, arm.base_.y_mm + fy}};
    place.by_phi_mm = arm.phi_arm_mm_ * cell.half_fold;
    const double radius =
        std::max(arm.theta_arm_mm_, std::sqrt(fx * fx + fy * fy) + place.by_phi_mm);
    place.by_theta_mm = radius * cell.half_theta;
    return place;
  }

  static double Largest(const CellPlace& place) {
    return std::max(place.by_theta_mm, place.by_phi_mm);
  }

  static std::pair<Cell, Cell> Halves(const Cell& cell, const CellPlace& place) {
    Cell lower = cell;
    if (place.by_theta_mm >= place.by_phi_mm) {
      lower.half_theta /= 2;
      Cell upper = lower;
      lower.theta -= lower.half_theta;
      upper.theta += lower.half_theta;
      return {lower, upper};
    }
    lower.half_fold /= 2;
    Cell upper = lower;
    lower.fold -= lower.half_fold;
    upper.fold += lower.half_fold;
    return {lower, upper};
  }

  double need_mm_;
  int budget_;
};

bool SweepsClear(const ArmGeometry& a, const PoseBox& box_a, const ArmGeometry& b,
                 const PoseBox& box_b, double need_mm, int budget) {
  const double dx = a.base_fp().x_mm - b.base_fp().x_mm;
  const double dy = a.base_fp().y_mm - b.base_fp().y_mm;
  const double reach = need_mm +
                       std::max(a.theta_arm_mm(), a.FibreRadiusMax(box_a.low[1], box_a.high[1])) +
                       std::max(b.theta_arm_mm(), b.FibreRadiusMax(box_b.low[1], box_b.high[1]));
  if (dx * dx + dy * dy > reach * reach) return true;
  return SweepTest(need_mm, budget).BothClear(a, box_a, b, box_b);
}

bool SweepClearOf(const ArmGeometry& a, const PoseBox& box_a, const Capsule& standing,
                  double need_mm, int budget) {
  return SweepTest(need_mm + standing.radius_mm, budget).ClearOf(a, box_a, standing.line);
}

}  // namespace focalfleet
