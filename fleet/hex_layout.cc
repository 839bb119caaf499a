#include "fleet/hex_layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <unordered_map>

namespace focalfleet {
namespace {

constexpr double kArmPerPitch = 16.5 / 2 / 25.6;
constexpr double kThetaEndDeg = 190;
constexpr double kPhiMaxDeg = 180;
constexpr double kFiducialRoomMm = 1.5;  // a ferrule of 2 mm and the clearance
constexpr double kGoldenTurn = 0.38196601125010515;

struct LatticePoint {
  int q = 0;
  int r = 0;
  int distance2 = 0;  // in pitches
};

std::vector<PointFp> LatticeNearestFirst(std::uint32_t count, double pitch_mm) {
  // The circle of `count` points contains only rings up to 1.16 times the hexagon's.
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

PointFp Seed(std::uint32_t k, double radius_mm) {
  const double turn = 2 * std::numbers::pi * kGoldenTurn * k;
  return {radius_mm * std::cos(turn), radius_mm * std::sin(turn)};
}

// Takes places in the pattern of a sunflower's seeds, each at the nearest place that is left. The
// others keep their order.
std::vector<Fiducial> TakePlaces(std::uint32_t count, std::vector<PointFp>* places) {
  const double rim_mm = std::hypot(places->back().x_mm, places->back().y_mm);
  std::vector<char> taken(places->size(), 0);
  std::vector<Fiducial> fiducials;
  for (std::uint32_t k = 0; k < count; ++k) {
    const PointFp seed = Seed(k, rim_mm * std::sqrt((k + 0.5) / count));
    std::size_t best = places->size();
    double best2 = 0;
    for (std::size_t i = 0; i < places->size(); ++i) {
      const double dx = (*places)[i].x_mm - seed.x_mm;
      const double dy = (*places)[i].y_mm - seed.y_mm;
      const double d2 = dx * dx + dy * dy;
      if (taken[i] != 0 || (best < places->size() && d2 >= best2)) continue;
      best = i;
      best2 = d2;
    }
    taken[best] = 1;
    fiducials.push_back({k + 1, (*places)[best]});
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < places->size(); ++i)
    if (taken[i] == 0) (*places)[kept++] = (*places)[i];
  places->resize(kept);
  return fiducials;
}

std::vector<Fiducial> RingOutside(std::uint32_t count, const std::vector<PointFp>& bases,
                                  double beyond_mm) {
  const double rim_mm = std::hypot(bases.back().x_mm, bases.back().y_mm);
  std::vector<Fiducial> fiducials;
  for (std::uint32_t k = 0; k < count; ++k)
    fiducials.push_back({k + 1, Seed(k, rim_mm + beyond_mm)});
  return fiducials;
}

std::size_t PartsOf(std::size_t size, std::uint32_t per_part) {
  return (size + per_part - 1) / per_part;
}

}  // namespace

HexPlate MakeHexPlate(const HexLayoutOptions& options) {
  const double theta_arm_mm =
      options.theta_arm_mm > 0 ? options.theta_arm_mm : kArmPerPitch * options.pitch_mm;
  const double phi_arm_mm = options.phi_arm_mm > 0 ? options.phi_arm_mm : theta_arm_mm;
  const double reach_mm = theta_arm_mm + phi_arm_mm + kHalfWidthShare * options.pitch_mm;
  const bool place_is_free = options.pitch_mm - reach_mm > kFiducialRoomMm;
  HexPlate plate;
  std::vector<PointFp> points = LatticeNearestFirst(
      options.count + (place_is_free ? options.fiducials : 0), options.pitch_mm);
  if (options.fiducials > 0)
    plate.fiducials = place_is_free
                          ? TakePlaces(options.fiducials, &points)
                          : RingOutside(options.fiducials, points, reach_mm + kFiducialRoomMm);
  std::vector<Unit>& units = plate.units;
  units.resize(points.size());
  std::vector<std::uint32_t> order(points.size());
  for (std::uint32_t i = 0; i < units.size(); ++i) {
    order[i] = i;
    units[i].id = UnitId{i + 1};
    units[i].base_fp = points[i];
    units[i].axis[Index(Axis::kTheta)] = {theta_arm_mm, 0, kHexLayoutGear, -kThetaEndDeg,
                                          kThetaEndDeg};
    units[i].axis[Index(Axis::kPhi)] = {phi_arm_mm, 0, kHexLayoutGear, 0, kPhiMaxDeg};
    units[i].sensors = options.sensors;
    if (options.sensors > 0)
      units[i].carrier_mm =
          options.carrier_mm > 0 ? options.carrier_mm : 2 * (theta_arm_mm + phi_arm_mm);
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
  return plate;
}

std::vector<Unit> MakeHexLayout(const HexLayoutOptions& options) {
  return MakeHexPlate(options).units;
}

}  // namespace focalfleet
