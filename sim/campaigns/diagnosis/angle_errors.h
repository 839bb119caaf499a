// What each seen place says of an axis' angle, where the arms' pose tells the two axes apart.
#pragma once

#include <cstddef>
#include <numbers>
#include <vector>

#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

struct AngleRow {
  std::size_t move = 0;  // of the track
  double error_deg = 0;  // measured less predicted
  double lever_mm = 0;   // by which a place tells the angle

  /// Of noise_mm in the place.
  [[nodiscard]] double sigma_deg(double noise_mm) const {
    return noise_mm / lever_mm * 180 / std::numbers::pi;
  }
};

/// Rows that are set aside tell nothing. Pre: the track is of the fit's campaign and model.
std::vector<AngleRow> AngleErrors(const Fit& fit, const UnitTrack& track, std::size_t axis);

}  // namespace focalfleet::sim
