#include "daemon/page/plate_layout.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

/// To 0.1 um: far below a pixel, and half the bytes.
double Rounded(double mm) { return std::round(mm * 1e4) / 1e4; }

template <class ValueOf>
nlohmann::json ColumnOf(const Layout& layout, ValueOf value_of) {
  nlohmann::json column = nlohmann::json::array();
  for (std::uint32_t i = 0; i < layout.size(); ++i) column.push_back(value_of(layout.unit({i})));
  const bool equal = !column.empty() && std::ranges::all_of(column, [&](const auto& value) {
    return value == column.front();
  });
  return equal ? nlohmann::json(column.front()) : column;
}

}  // namespace

std::string LayoutJson(const Layout& layout, std::span<const std::uint32_t> sectors) {
  nlohmann::json units;
  const auto add = [&](const char* name, auto value_of) {
    units[name] = ColumnOf(layout, value_of);
  };
  add("id", [](const Unit& unit) { return unit.id.value; });
  add("x_mm", [](const Unit& unit) { return Rounded(unit.base_fp.x_mm); });
  add("y_mm", [](const Unit& unit) { return Rounded(unit.base_fp.y_mm); });
  add("arm_theta_mm", [](const Unit& unit) { return Rounded(unit.theta().arm_mm); });
  add("arm_phi_mm", [](const Unit& unit) { return Rounded(unit.phi().arm_mm); });
  add("half_width_mm", [](const Unit& unit) { return Rounded(unit.arm_half_width_mm); });
  add("patrol_min_mm", [](const Unit& unit) { return Rounded(PatrolOf(unit).min_mm); });
  add("patrol_max_mm", [](const Unit& unit) { return Rounded(PatrolOf(unit).max_mm); });
  add("bus", [](const Unit& unit) { return unit.bus.value; });
  add("node", [](const Unit& unit) { return unit.node.value; });
  add("rail", [](const Unit& unit) { return unit.rail.value; });
  if (!sectors.empty())
    units["sector"] = std::vector<std::uint32_t>(sectors.begin(), sectors.end());
  nlohmann::json obstacles = nlohmann::json::array();
  for (const Obstacle& obstacle : layout.obstacles())
    obstacles.push_back({{"id", obstacle.id},
                         {"x_mm", Rounded(obstacle.centre_fp.x_mm)},
                         {"y_mm", Rounded(obstacle.centre_fp.y_mm)},
                         {"radius_mm", Rounded(obstacle.radius_mm)}});
  return nlohmann::json{{"count", layout.size()},
                        {"units", std::move(units)},
                        {"obstacles", std::move(obstacles)},
                        {"pitch_mm", layout.pitch_mm()}}
      .dump();
}

}  // namespace focalfleet
