#include "tests/hidden/generator/layout.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace focalfleet::hidden {

namespace {

struct Proportions {
  double pitch_mm;
  ByAxis arm_mm;
  ByAxis gear;
};

Proportions Of(PositionerType type) {
  constexpr double kGearhead = 337.3594;  // (60/14)^4
  constexpr double kWithSpur = kGearhead * 45 / 17;
  switch (type) {
    case PositionerType::kEqualShort:
      return {10.4, {3.0, 3.1}, {kGearhead, kGearhead}};
    case PositionerType::kLongPhi:
      return {22.4, {7.4, 14.3}, {kWithSpur, kWithSpur}};
    case PositionerType::kEqualLong:
      break;
  }
  return {25.6, {8.25, 8.25}, {kWithSpur, kWithSpur}};
}

std::vector<Place> Lattice(std::size_t count, double pitch_mm) {
  std::vector<Place> places;
  const int reach = 3 + static_cast<int>(std::sqrt(static_cast<double>(count)));
  for (int a = -reach; a <= reach; ++a)
    for (int b = -reach; b <= reach; ++b)
      places.push_back(pitch_mm * Place(a + 0.5 * b, std::sqrt(3.0) / 2 * b));
  std::sort(places.begin(), places.end(), [](const Place& l, const Place& r) {
    const auto key = [](const Place& p) {
      return std::pair{std::round(std::norm(p) * 1e3), std::arg(p)};
    };
    return key(l) < key(r);
  });
  places.resize(count);
  return places;
}

// Sorts by `key`, cuts into groups of equal size and calls `give` with (group, slot) of each unit.
template <class Key, class Give>
void Group(const std::vector<Unit>& units, std::size_t groups, const Key& key, const Give& give) {
  std::vector<std::size_t> order(units.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return key(units[a]) < key(units[b]); });
  const std::size_t size = (units.size() + groups - 1) / groups;
  for (std::size_t i = 0; i < order.size(); ++i)
    give(order[i], static_cast<int>(i / size), static_cast<int>(i % size));
}

}  // namespace

Place FibreAt(const Geometry& geometry, const ByAxis& angle_deg) {
  const double first = (angle_deg[kTheta] + geometry.zero_deg[kTheta]) * kDegree;
  const double second = first + (angle_deg[kPhi] + geometry.zero_deg[kPhi]) * kDegree;
  // A diverging fit may try an arm of negative length, which std::polar does not take.
  return geometry.base_mm + geometry.arm_mm[kTheta] * std::polar(1.0, first) +
         geometry.arm_mm[kPhi] * std::polar(1.0, second);
}

std::vector<Unit> MakePlate(PositionerType type, std::size_t count, Rng* rng, double* pitch_mm) {
  const Proportions proportions = Of(type);
  *pitch_mm = proportions.pitch_mm;
  std::vector<Unit> units(count);
  const auto places = Lattice(count, proportions.pitch_mm);
  const double phi_zero_deg = rng->Uniform(-4, 4);
  int id = 0;
  for (std::size_t u = 0; u < count; ++u) {
    Unit& unit = units[u];
    id += 1 + static_cast<int>(rng->Below(3));
    unit.id = id;
    unit.believed.base_mm = places[u];
    unit.believed.arm_mm = proportions.arm_mm;
    unit.believed.zero_deg = {std::round(rng->Uniform(-180, 180) * 100) / 100,
                              std::round(phi_zero_deg * 100) / 100};
    unit.gear = proportions.gear;
    unit.min_deg = {-190, 0};
    unit.max_deg = {190, 182};
  }
  const std::size_t rails = std::clamp<std::size_t>(count / 12, 2, 12);
  const std::size_t buses = std::clamp<std::size_t>(count / 16, 2, 10);
  Group(
      units, rails,
      [](const Unit& unit) { return std::arg(unit.believed.base_mm + Place(1e-3, 0)); },
      [&](std::size_t u, int rail, int slot) {
        units[u].rail = rail;
        units[u].rail_slot = slot;
      });
  Group(
      units, buses, [](const Unit& unit) { return unit.believed.base_mm.imag(); },
      [&](std::size_t u, int bus, int slot) {
        units[u].bus = bus;
        units[u].bus_slot = slot;
      });
  return units;
}

std::vector<std::vector<std::size_t>> Neighbours(const Campaign& campaign) {
  std::vector<std::vector<std::size_t>> near(campaign.unit_count());
  const double reach_mm = 1.3 * campaign.pitch_mm;
  for (std::size_t a = 0; a < near.size(); ++a)
    for (std::size_t b = 0; b < near.size(); ++b)
      if (a != b && std::abs(campaign.units[a].believed.base_mm -
                             campaign.units[b].believed.base_mm) < reach_mm)
        near[a].push_back(b);
  return near;
}

}  // namespace focalfleet::hidden
