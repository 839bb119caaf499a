// Distances in the plane. A unit's touchable part is a stadium: a segment (the arm from elbow to
// fibre) and a half-width around it. An obstacle is a point with a radius. Two of them are clear of
// each other when the distance of their cores exceeds the sum of the widths. The functions here
// therefore measure from core to core.
#pragma once

#include <algorithm>
#include <cmath>

#include "fleet/layout.h"

namespace focalfleet {

struct SegmentFp {
  PointFp a;
  PointFp b;
};

constexpr double SquaredDistance(PointFp p, PointFp q) {
  const double dx = p.x_mm - q.x_mm;
  const double dy = p.y_mm - q.y_mm;
  return dx * dx + dy * dy;
}
inline double DistanceMm(PointFp p, PointFp q) { return std::sqrt(SquaredDistance(p, q)); }

/// Squared distance from a point to the nearest point of a segment. Units: mm^2.
constexpr double SquaredDistance(PointFp p, const SegmentFp& s) {
  const double dx = s.b.x_mm - s.a.x_mm;
  const double dy = s.b.y_mm - s.a.y_mm;
  const double length2 = dx * dx + dy * dy;
  if (length2 <= 0) return SquaredDistance(p, s.a);
  const double along = ((p.x_mm - s.a.x_mm) * dx + (p.y_mm - s.a.y_mm) * dy) / length2;
  const double t = std::clamp(along, 0.0, 1.0);
  return SquaredDistance(p, PointFp{s.a.x_mm + t * dx, s.a.y_mm + t * dy});
}
inline double DistanceMm(PointFp p, const SegmentFp& s) { return std::sqrt(SquaredDistance(p, s)); }

/// `share` / `whole` within 0..1, without a division where it is beyond. Pre: `whole` is above 0.
constexpr double ClampedShare(double share, double whole) {
  return share <= 0 ? 0.0 : share >= whole ? 1.0 : share / whole;
}

/// Squared distance of two segments, 0 within rounding where they cross. The nearest points of the
/// two lines are moved to the ends where they lie beyond (Ericson, Real-Time Collision Detection,
/// 5.1.9). Where the two are almost parallel the nearest points are ill-conditioned, but their
/// distance is not: it stays within 1e-6 mm. Planners spend a quarter of their time here, and ends
/// are nearest far more often than not: hence no division where the answer is an end. Units: mm^2.
constexpr double SquaredDistance(const SegmentFp& s, const SegmentFp& t) {
  const double ux = s.b.x_mm - s.a.x_mm;
  const double uy = s.b.y_mm - s.a.y_mm;
  const double vx = t.b.x_mm - t.a.x_mm;
  const double vy = t.b.y_mm - t.a.y_mm;
  const double wx = s.a.x_mm - t.a.x_mm;
  const double wy = s.a.y_mm - t.a.y_mm;
  const double uu = ux * ux + uy * uy;
  const double vv = vx * vx + vy * vy;
  if (uu <= 0) return SquaredDistance(s.a, t);
  if (vv <= 0) return SquaredDistance(t.a, s);
  const double uv = ux * vx + uy * vy;
  const double uw = ux * wx + uy * wy;
  const double vw = vx * wx + vy * wy;
  const double area2 = uu * vv - uv * uv;
  double p = area2 > 0 ? ClampedShare(uv * vw - uw * vv, area2) : 0;
  const double along = uv * p + vw;
  double q = along < 0 ? 0 : along / vv;
  if (along < 0 || q > 1) {
    q = along < 0 ? 0 : 1;
    p = ClampedShare(uv * q - uw, uu);
  }
  const double dx = wx + p * ux - q * vx;
  const double dy = wy + p * uy - q * vy;
  return dx * dx + dy * dy;
}
constexpr double SquaredDistanceOfMiddles(const SegmentFp& s, const SegmentFp& t) {
  const double dx = (s.a.x_mm + s.b.x_mm) - (t.a.x_mm + t.b.x_mm);
  const double dy = (s.a.y_mm + s.b.y_mm) - (t.a.y_mm + t.b.y_mm);
  return (dx * dx + dy * dy) / 4;
}
inline double DistanceMm(const SegmentFp& s, const SegmentFp& t) {
  return std::sqrt(SquaredDistance(s, t));
}

}  // namespace focalfleet
