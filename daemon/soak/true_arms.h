// Arms as the judge has them: where the shafts truly stand, by a kinematics of its own.
#pragma once

#include <algorithm>
#include <complex>
#include <numbers>

#include "fleet/layout.h"

namespace focalfleet::soak {

using Point = std::complex<double>;

/// The part of a unit that may touch others, without its width. Units: mm, focal-plane frame.
struct TrueArm {
  Point elbow;
  Point fibre;
};

inline TrueArm ArmOf(const Unit& unit, const std::array<double, kAxisCount>& angle_deg) {
  constexpr double kDegree = std::numbers::pi / 180;
  const double theta = (angle_deg[0] + unit.axis[0].zero_deg) * kDegree;
  const double phi = (angle_deg[1] + unit.axis[1].zero_deg) * kDegree;
  const Point base{unit.base_fp.x_mm, unit.base_fp.y_mm};
  const Point elbow = base + std::polar(unit.axis[0].arm_mm, theta);
  return {elbow, elbow + std::polar(unit.axis[1].arm_mm, theta + phi)};
}

inline double Cross(Point a, Point b) { return a.real() * b.imag() - a.imag() * b.real(); }
inline double Dot(Point a, Point b) { return a.real() * b.real() + a.imag() * b.imag(); }

inline double FromSegment(Point p, Point a, Point b) {
  const double length = std::norm(b - a);
  const double t = length > 0 ? std::clamp(Dot(p - a, b - a) / length, 0.0, 1.0) : 0.0;
  return std::abs(p - a - t * (b - a));
}

/// The distance of two arms: 0 where they cross, else that of an end. Units: mm.
inline double Between(const TrueArm& m, const TrueArm& n) {
  const Point a = m.elbow, b = m.fibre, c = n.elbow, d = n.fibre;
  const double side_c = Cross(b - a, c - a), side_d = Cross(b - a, d - a);
  const double side_a = Cross(d - c, a - c), side_b = Cross(d - c, b - c);
  if (side_c * side_d < 0 && side_a * side_b < 0) return 0;
  return std::min(
      {FromSegment(a, c, d), FromSegment(b, c, d), FromSegment(c, a, b), FromSegment(d, a, b)});
}

}  // namespace focalfleet::soak
