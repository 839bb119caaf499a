#include "sim/campaigns/diagnosis/angle_errors.h"

#include <cmath>

namespace focalfleet::sim {

std::vector<AngleRow> AngleErrors(const Fit& fit, const UnitTrack& track, std::size_t axis) {
  constexpr double kRadians = std::numbers::pi / 180;
  constexpr double kApart = 0.25;  // sine of the angle between the two tangents
  std::vector<AngleRow> rows;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    if (fit.aside[row] != 0 || !std::isfinite(fit.x_um[row])) continue;
    const double ax = -(track.elbow_y_mm[i] + track.reach_y_mm[i]);
    const double ay = track.elbow_x_mm[i] + track.reach_x_mm[i];
    const double bx = -track.reach_y_mm[i], by = track.reach_x_mm[i];
    const double det = ax * by - ay * bx;
    if (!(std::abs(det) > kApart * std::hypot(ax, ay) * std::hypot(bx, by))) continue;
    const double x = 1e-3 * fit.x_um[row], y = 1e-3 * fit.y_um[row];
    const double error = axis == kTheta ? (by * x - bx * y) / det : (ax * y - ay * x) / det;
    // Near the folded pose an angle of theta moves the fibre next to nothing.
    const double lever = std::abs(det) / (axis == kTheta ? std::hypot(bx, by) : std::hypot(ax, ay));
    rows.push_back({i, error / kRadians, lever});
  }
  return rows;
}

}  // namespace focalfleet::sim
