#include "sim/campaigns/diagnosis/model/angle_errors.h"

#include <cmath>

namespace focalfleet::sim {

std::optional<AngleRow> AngleErrorAt(const UnitTrack& track, std::size_t move, std::size_t axis,
                                     double x_um, double y_um) {
  constexpr double kRadians = std::numbers::pi / 180;
  constexpr double kApart = 0.25;  // sine of the angle between the two tangents
  const double ax = -(track.elbow_y_mm[move] + track.reach_y_mm[move]);
  const double ay = track.elbow_x_mm[move] + track.reach_x_mm[move];
  const double bx = -track.reach_y_mm[move], by = track.reach_x_mm[move];
  const double det = ax * by - ay * bx;
  if (!(std::abs(det) > kApart * std::hypot(ax, ay) * std::hypot(bx, by))) return std::nullopt;
  const double x = 1e-3 * x_um, y = 1e-3 * y_um;
  const double error = axis == kTheta ? (by * x - bx * y) / det : (ax * y - ay * x) / det;
  // Near the folded pose an angle of theta moves the fibre next to nothing.
  const double lever = std::abs(det) / (axis == kTheta ? std::hypot(bx, by) : std::hypot(ax, ay));
  return AngleRow{move, error / kRadians, lever};
}

std::vector<AngleRow> AngleErrors(const Fit& fit, const UnitTrack& track, std::size_t axis) {
  std::vector<AngleRow> rows;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    if (fit.aside[row] != 0 || !std::isfinite(fit.x_um[row])) continue;
    if (const auto found = AngleErrorAt(track, i, axis, fit.x_um[row], fit.y_um[row]))
      rows.push_back(*found);
  }
  return rows;
}

}  // namespace focalfleet::sim
