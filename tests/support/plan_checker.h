// The checker is an independent witness for plans. Its rules are what docs/files.md states about
// rows and about "clear". No line is shared with the planner: kinematics, distance of two segments
// and reading of the files are the checker's own.
//
// The checker walks along time instead of sampling it blindly. Two arms that are d apart and
// approach with at most v cannot touch for (d - need) / v. The next look is then. Where they are
// already as near as the rule allows, the step is the time in which they travel 1 um. A violation
// deeper than that cannot be stepped over.
//
// The walk is made for every pair of units in reach, with nominal clocks and at the corners of
// start skew and clock error.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace focalfleet::test {

struct CheckedAxis {
  double arm_mm = 0;
  double zero_deg = 0;
  double min_deg = 0;
  double max_deg = 0;
  double start_deg = 0;
};

struct CheckedUnit {
  std::uint32_t id = 0;
  double base_x_mm = 0;
  double base_y_mm = 0;
  CheckedAxis axis[2];       // theta, phi
  double half_width_mm = 0;  // 0: 0.08 of the distance to the nearest neighbour
  bool known = true;         // false: its place is not known, pairs with it are not checked
  bool enabled = true;       // false: any row of it is a fault
};

struct CheckedRow {
  std::uint32_t unit = 0;
  int axis = 0;  // 0 theta, 1 phi
  double t0_s = 0;
  double t1_s = 0;
  double from_deg = 0;
  double to_deg = 0;
};

struct CheckedObstacle {
  std::uint32_t id = 0;
  double x_mm = 0;
  double y_mm = 0;
  double radius_mm = 0;
};

struct CheckOptions {
  double clearance_mm = 0;  // 0: 0.012 of the median distance to the nearest neighbour
  double tolerance_mm = 0.002;
  double start_skew_s = 0.020;
  double clock_error = 0.005;
};

struct CheckReport {
  /// The smallest "distance minus what is needed" of any pair, with pair and time. Units: mm, s.
  double worst_margin_mm = 1e9;
  std::uint32_t worst_a = 0;
  std::uint32_t worst_b = 0;
  double worst_t_s = 0;
  std::uint64_t looks = 0;
  double end_s = 0;
  std::vector<std::string> faults;                              // empty: the plan keeps every rule
  std::map<std::uint32_t, std::pair<double, double>> ends_deg;  // theta, phi at the end, by unit
  [[nodiscard]] bool ok() const { return faults.empty(); }
  [[nodiscard]] std::string Text() const;  // the first few faults and the worst margin
};

CheckReport CheckPlan(std::vector<CheckedUnit> units, const std::vector<CheckedRow>& rows,
                      const std::vector<CheckedObstacle>& obstacles, const CheckOptions& options);

/// Reads units.csv, state.csv, plan.csv and obstacles.csv, and checks the plan. An empty path means
/// no obstacles. The places of units that the state does not name are not known. A file that cannot
/// be read is a fault.
CheckReport CheckPlanFiles(const std::string& units_path, const std::string& state_path,
                           const std::string& plan_path, const std::string& obstacles_path,
                           const CheckOptions& options);

}  // namespace focalfleet::test
