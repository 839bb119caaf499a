#include "fleet/files/obstacles_file.h"

#include <unordered_map>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"

namespace focalfleet {

Result<std::vector<Obstacle>> ReadObstacles(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"obstacle_id", "x_mm", "y_mm", "radius_mm"}));
  std::vector<Obstacle> obstacles;
  std::unordered_map<std::uint32_t, int> line_of;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    Obstacle obstacle;
    obstacle.id = static_cast<std::uint32_t>(row.Integer("obstacle_id", {0, UINT32_MAX}));
    obstacle.centre_fp = {row.Number("x_mm"), row.Number("y_mm")};
    obstacle.radius_mm = row.Number("radius_mm");
    if (obstacle.radius_mm < 0) row.Reject("radius_mm", row.Text("radius_mm") + " is negative");
    if (row.error()) return;
    if (const auto [it, fresh] = line_of.emplace(obstacle.id, row.line()); !fresh)
      return row.RejectRow("obstacle " + std::to_string(obstacle.id) +
                               ": is there twice, first in " + LineOrRow(it->second),
                           "is there twice");
    obstacles.push_back(obstacle);
  }));
  return obstacles;
}

std::string WriteObstacles(std::span<const Obstacle> obstacles) {
  CsvWriter csv({"obstacle_id", "x_mm", "y_mm", "radius_mm"});
  for (const Obstacle& o : obstacles)
    csv.Integer(o.id)
        .Number(o.centre_fp.x_mm)
        .Number(o.centre_fp.y_mm)
        .Number(o.radius_mm)
        .EndRow();
  return csv.Take();
}

}  // namespace focalfleet
