// Distances in the plane. What can touch on the plate is a stadium: a segment (the arm from elbow
// to fibre) and a half-width around it; an obstacle is a point with a radius. Two of them are clear
// of each other when the distance of their cores exceeds the sum of the widths, so all that is
// asked here is core to core.
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

/// Twice the signed area of the triangle: positive where a, b, c turn counter-clockwise.
constexpr double DoubleArea(PointFp a, PointFp b, PointFp c) {
  return (b.x_mm - a.x_mm) * (c.y_mm - a.y_mm) - (b.y_mm - a.y_mm) * (c.x_mm - a.x_mm);
}

/// Strictly crossing; segments that only touch have distance 0 by their end points anyway.
constexpr bool Crosses(const SegmentFp& s, const SegmentFp& t) {
  const double s1 = DoubleArea(t.a, t.b, s.a);
  const double s2 = DoubleArea(t.a, t.b, s.b);
  const double t1 = DoubleArea(s.a, s.b, t.a);
  const double t2 = DoubleArea(s.a, s.b, t.b);
  return ((s1 > 0 && s2 < 0) || (s1 < 0 && s2 > 0)) && ((t1 > 0 && t2 < 0) || (t1 < 0 && t2 > 0));
}

/// Squared distance of two segments, 0 where they cross. Units: mm^2.
constexpr double SquaredDistance(const SegmentFp& s, const SegmentFp& t) {
  if (Crosses(s, t)) return 0;
  return std::min({SquaredDistance(s.a, t), SquaredDistance(s.b, t), SquaredDistance(t.a, s),
                   SquaredDistance(t.b, s)});
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
