// The part of a unit that can touch others, and the test whether two of them are clear for good.
// The arm is the segment from elbow to fibre. Let both angles of a unit vary within a box [theta] x
// [phi]. Then no point of the arm is farther from where it is in the box's middle than
//     R * d_theta + L2 * d_phi
// The half-widths of the box are in radians, R is the farthest point of the arm from the base, and
// L2 is the phi arm. Turning by an angle moves a point by at most its radius times the angle. A
// single distance of two segments thus decides about two whole boxes of poses, or the boxes are
// halved and tested again. Nothing is sampled: "clear" holds for every pose in the boxes. "Not
// clear" may be returned for boxes that are clear by less than a few micrometres.
#pragma once

#include <cstdint>
#include <span>

#include "fleet/drive.h"
#include "fleet/geometry/segment.h"
#include "fleet/geometry/turn.h"
#include "fleet/layout.h"

namespace focalfleet {

/// All poses between two corners, both included. Units: vectors.
struct PoseBox {
  Pose low{};
  Pose high{};
  static constexpr PoseBox Of(const Pose& p) { return {p, p}; }
  static constexpr PoseBox Between(const Pose& a, const Pose& b) {
    PoseBox box;
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      box.low[k] = a[k] < b[k] ? a[k] : b[k];
      box.high[k] = a[k] < b[k] ? b[k] : a[k];
    }
    return box;
  }
  [[nodiscard]] constexpr bool Contains(const Pose& p) const {
    return low[0] <= p[0] && p[0] <= high[0] && low[1] <= p[1] && p[1] <= high[1];
  }
  constexpr bool operator==(const PoseBox&) const = default;
};

/// Kinematics of one unit, with everything that does not change computed once.
class ArmGeometry {
 public:
  ArmGeometry() = default;
  ArmGeometry(const Unit& unit, const UnitDrive& drive);

  /// The phi arm, `a` the elbow and `b` the fibre.
  [[nodiscard]] SegmentFp At(const Pose& pose) const;
  /// The same for angles that need not be whole vectors; as Theta and Fold give them. Units: rad.
  [[nodiscard]] SegmentFp AtAngles(double theta_rad, double fold_rad) const {
    const Direction inner = DirectionOf(theta_rad);
    const Direction outer = DirectionOf(theta_rad + fold_rad);
    const PointFp elbow{base_.x_mm + theta_arm_mm_ * inner.cos,
                        base_.y_mm + theta_arm_mm_ * inner.sin};
    return {elbow, {elbow.x_mm + phi_arm_mm_ * outer.cos, elbow.y_mm + phi_arm_mm_ * outer.sin}};
  }
  /// Largest distance of the fibre from the base over a range of phi. Units: vectors, mm.
  [[nodiscard]] double FibreRadiusMax(std::int32_t phi_low, std::int32_t phi_high) const {
    return FibreRadiusMaxFold(Fold(phi_low), Fold(phi_high));
  }
  [[nodiscard]] double FibreRadiusMaxFold(double low_rad, double high_rad) const;
  /// Direction of the theta arm in the focal plane. Units: rad.
  [[nodiscard]] double Theta(std::int32_t theta) const {
    return theta_zero_rad_ + theta * theta_step_rad_;
  }
  /// Angle between theta arm and phi arm: 0 stretched out, pi folded back. Units: rad.
  [[nodiscard]] double Fold(std::int32_t phi) const { return phi_zero_rad_ + phi * phi_step_rad_; }

  [[nodiscard]] const PointFp& base_fp() const { return base_; }
  [[nodiscard]] double theta_arm_mm() const { return theta_arm_mm_; }
  [[nodiscard]] double phi_arm_mm() const { return phi_arm_mm_; }
  [[nodiscard]] double half_width_mm() const { return half_width_mm_; }
  [[nodiscard]] double phi_zero_rad() const { return phi_zero_rad_; }
  /// Radians a vector. Shape: (axes).
  [[nodiscard]] double step_rad(Axis axis) const {
    return axis == Axis::kTheta ? theta_step_rad_ : phi_step_rad_;
  }
  /// The range lies so much further on from now on. Units: vectors.
  void ShiftRange(const Pose& offset) {
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      range_.low[k] += offset[k];
      range_.high[k] += offset[k];
    }
  }
  /// Every pose that the axes' ranges allow.
  [[nodiscard]] const PoseBox& range() const { return range_; }
  /// Bound on how far any point of the arm moves for these changes of the angles. Units: vectors,
  /// mm.
  [[nodiscard]] double TravelBound(double theta_vectors, double phi_vectors) const {
    return (theta_arm_mm_ + phi_arm_mm_) * theta_vectors * theta_step_rad_ +
           phi_arm_mm_ * phi_vectors * phi_step_rad_;
  }

 private:
  friend class SweepTest;
  PointFp base_;
  double theta_arm_mm_ = 0;
  double phi_arm_mm_ = 0;
  double half_width_mm_ = 0;
  double theta_zero_rad_ = 0;
  double phi_zero_rad_ = 0;
  double theta_step_rad_ = 0;
  double phi_step_rad_ = 0;
  PoseBox range_;
};

/// A segment with a radius of its own beyond the half-widths. Examples are a standing arm (radius
/// 0), a disc (both ends equal), and one piece of the cover of all possible poses of a unit.
struct Capsule {
  SegmentFp line;
  double radius_mm = 0;
};

/// A set of poses that one leg of a way may pass. The axes go from one pose to the other. Theta has
/// covered a fraction f of its way and phi a fraction g of its own, with |f - g| <= `out_of_step`.
/// The value 1 is the whole box between the poses, less is a band around its diagonal.
struct Sweep {
  Pose from{};
  Pose to{};
  double out_of_step = 1;
  static constexpr Sweep Of(const Pose& p) { return {p, p, 1}; }
  static constexpr Sweep Of(const PoseBox& box) { return {box.low, box.high, 1}; }
  [[nodiscard]] constexpr PoseBox box() const { return PoseBox::Between(from, to); }
};

/// True: every pose of `a` in `sweep_a` stays farther than `need_mm` from every pose of `b` in
/// `sweep_b`. Cost: at most `budget` distances. More would be needed only where the two nearly
/// touch; the answer is then false.
bool SweepsClear(const ArmGeometry& a, const Sweep& sweep_a, const ArmGeometry& b,
                 const Sweep& sweep_b, double need_mm, int budget = 3000);

/// The same against something that stands still.
bool SweepClearOf(const ArmGeometry& a, const Sweep& sweep, const Capsule& standing, double need_mm,
                  int budget = 3000);

}  // namespace focalfleet
