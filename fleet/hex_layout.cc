#include "fleet/hex_layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <unordered_map>

namespace focalfleet {
namespace {

constexpr double kGear = 337.0 * 45 / 17;
constexpr double kArmPerPitch = 16.5 / 2 / 25.6;
constexpr double kThetaEndDeg = 190;
constexpr double kPhiMaxDeg = 180;

struct LatticePoint {
  int q = 0;
  int r = 0;
  int distance2 = 0;  // in pitches
};

std::vector<PointFp> LatticeNearestFirst(std::uint32_t count, double pitch_mm) {
  // Within the circle that holds `count` points stand only rings up to 1.16 times the hexagon's.
  int rings = 1;
  while (3.0 * rings * (rings + 1) + 1 < count) ++rings;
  rings += rings / 4 + 1;
  std::vector<LatticePoint> lattice;
  for (int q = -rings; q <= rings; ++q)
    for (int r = std::max(-rings, -q - rings); r <= std::min(rings, -q + rings); ++r)
      lattice.push_back({q, r, q * q + q * r + r * r});
  std::sort(lattice.begin(), lattice.end(), [](const LatticePoint& a, const LatticePoint& b) {
    if (a.distance2 != b.distance2) return a.distance2 < b.distance2;
    return a.r != b.r ? a.r < b.r : a.q < b.q;
  });
  std::vector<PointFp> points;
  for (std::uint32_t k = 0; k < count; ++k)
    points.push_back({pitch_mm * (lattice[k].q + lattice[k].r * 0.5),
                      pitch_mm * lattice[k].r * std::numbers::sqrt3 / 2});
  return points;
}

// Cuts a region across its longer side until it has come down to `parts` parts of even size, and
// calls `take(part)` for each.
template <class Take>
void CutEvenly(const std::vector<PointFp>& points, std::span<std::uint32_t> region,
               std::size_t parts, const Take& take) {
  if (parts <= 1) return take(region);
  const auto by_x = [&](std::uint32_t a, std::uint32_t b) {
    return points[a].x_mm != points[b].x_mm ? points[a].x_mm < points[b].x_mm : a < b;
  };
  const auto by_y = [&](std::uint32_t a, std::uint32_t b) {
    return points[a].y_mm != points[b].y_mm ? points[a].y_mm < points[b].y_mm : a < b;
  };
  const auto [left, right] = std::minmax_element(region.begin(), region.end(), by_x);
  const auto [bottom, top] = std::minmax_element(region.begin(), region.end(), by_y);
  const bool wide =
      points[*right].x_mm - points[*left].x_mm >= points[*top].y_mm - points[*bottom].y_mm;
  if (wide) {
    std::sort(region.begin(), region.end(), by_x);
  } else {
    std::sort(region.begin(), region.end(), by_y);
  }
  const std::size_t first_parts = parts / 2;
  const std::size_t first_size = region.size() * first_parts / parts;
  CutEvenly(points, region.first(first_size), first_parts, take);
  CutEvenly(points, region.subspan(first_size), parts - first_parts, take);
}

std::size_t PartsOf(std::size_t size, std::uint32_t per_part) {
  return (size + per_part - 1) / per_part;
}

}  // namespace

std::vector<Unit> MakeHexLayout(const HexLayoutOptions& options) {
  const std::vector<PointFp> points = LatticeNearestFirst(options.count, options.pitch_mm);
  const double theta_arm_mm =
      options.theta_arm_mm > 0 ? options.theta_arm_mm : kArmPerPitch * options.pitch_mm;
  const double phi_arm_mm = options.phi_arm_mm > 0 ? options.phi_arm_mm : theta_arm_mm;
  std::vector<Unit> units(points.size());
  std::vector<std::uint32_t> order(points.size());
  for (std::uint32_t i = 0; i < units.size(); ++i) {
    order[i] = i;
    units[i].id = UnitId{i + 1};
    units[i].base_fp = points[i];
    units[i].axis[Index(Axis::kTheta)] = {theta_arm_mm, 0, kGear, -kThetaEndDeg, kThetaEndDeg};
    units[i].axis[Index(Axis::kPhi)] = {phi_arm_mm, 0, kGear, 0, kPhiMaxDeg};
  }
  std::uint32_t rail = 0;
  std::uint32_t bus = 0;
  CutEvenly(points, order, PartsOf(points.size(), options.units_per_rail),
            [&](std::span<std::uint32_t> on_rail) {
              CutEvenly(points, on_rail, PartsOf(on_rail.size(), options.units_per_bus),
                        [&](std::span<std::uint32_t> on_bus) {
                          for (const std::uint32_t i : on_bus) {
                            units[i].rail = RailId{rail};
                            units[i].bus = BusId{bus};
                          }
                          ++bus;
                        });
              ++rail;
            });
  std::unordered_map<BusId, std::uint8_t> nodes;
  for (Unit& unit : units) unit.node = NodeId{++nodes[unit.bus]};
  return units;
}

}  // namespace focalfleet
