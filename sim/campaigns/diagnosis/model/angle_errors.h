// The error of an axis' angle at each seen place, where the arms' pose separates the two axes.
#pragma once

#include <cstddef>
#include <numbers>
#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

struct AngleRow {
  std::size_t move = 0;  // of the track
  double error_deg = 0;  // measured less predicted
  double lever_mm = 0;   // motion of the place per radian of the angle

  /// Standard deviation of the error where that of the place is noise_mm.
  [[nodiscard]] double sigma_deg(double noise_mm) const {
    return noise_mm / lever_mm * 180 / std::numbers::pi;
  }
};

/// The error of the axis' angle that moves the place of the move's fibre by (x, y). nullopt where
/// the pose does not separate the axes.
std::optional<AngleRow> AngleErrorAt(const UnitTrack& track, std::size_t move, std::size_t axis,
                                     double x_um, double y_um);

/// The errors of all rows that are not set aside. Pre: the track is of the fit's campaign and
/// model.
std::vector<AngleRow> AngleErrors(const Fit& fit, const UnitTrack& track, std::size_t axis);

}  // namespace focalfleet::sim
