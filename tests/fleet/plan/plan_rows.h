// The planner's types become the checker's: whole vectors become degrees and ticks become seconds
// here, by the definitions of files.md and not by the planner's own helpers.
#pragma once

#include <cmath>
#include <cstdlib>
#include <span>
#include <vector>

#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"
#include "tests/support/plan_checker.h"

namespace focalfleet::test {

inline double DegreesOf(std::int32_t vectors, const Unit& unit, const UnitDrive& drive,
                        std::size_t axis) {
  return vectors * 360.0 / (drive.axis[axis].subdivision * unit.axis[axis].gear);
}

inline std::vector<CheckedUnit> CheckedUnits(const Layout& layout,
                                             std::span<const UnitDrive> drives,
                                             std::span<const UnitKnowledge> start,
                                             std::span<const std::uint8_t> frozen) {
  std::vector<CheckedUnit> checked;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    const Unit& unit = layout.unit({i});
    CheckedUnit c;
    c.id = unit.id.value;
    c.base_x_mm = unit.base_fp.x_mm;
    c.base_y_mm = unit.base_fp.y_mm;
    c.half_width_mm = unit.arm_half_width_mm;
    c.known = IsPlace(start[i]);
    c.enabled = unit.enabled && (frozen.empty() || frozen[i] == 0);
    for (std::size_t k = 0; k < kAxisCount; ++k)
      c.axis[k] = {unit.axis[k].arm_mm, unit.axis[k].zero_deg, unit.axis[k].min_deg,
                   unit.axis[k].max_deg, DegreesOf(start[i][k].low, unit, drives[i], k)};
    checked.push_back(c);
  }
  return checked;
}

inline std::vector<CheckedRow> CheckedRows(const Plan& plan, const Layout& layout,
                                           std::span<const UnitDrive> drives) {
  std::vector<CheckedRow> rows;
  for (const UnitPlan& move : plan.moves) {
    const Unit& unit = layout.unit(move.unit);
    const UnitDrive& drive = drives[move.unit.value];
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      std::int32_t at = move.from[k];
      for (const Segment& segment : move.path[k].segments()) {
        CheckedRow row;
        row.unit = unit.id.value;
        row.axis = static_cast<int>(k);
        row.t0_s = segment.start_ticks * 1e-4;
        row.t1_s = row.t0_s +
                   std::abs(segment.delta) * (segment.repeat * (drive.axis[k].counter1 / 144e6));
        row.from_deg = DegreesOf(at, unit, drive, k);
        at += segment.delta;
        row.to_deg = DegreesOf(at, unit, drive, k);
        rows.push_back(row);
      }
    }
  }
  return rows;
}

inline std::vector<CheckedObstacle> CheckedObstacles(const Layout& layout) {
  std::vector<CheckedObstacle> obstacles;
  for (const Obstacle& o : layout.obstacles())
    obstacles.push_back({o.id, o.centre_fp.x_mm, o.centre_fp.y_mm, o.radius_mm});
  return obstacles;
}

}  // namespace focalfleet::test
