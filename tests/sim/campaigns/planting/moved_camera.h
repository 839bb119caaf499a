// A camera that is moved between exposures of a campaign, with the column that says so.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim::test {

struct FrameAt {
  double id = 0;
  std::size_t until = 0;  // exposures
  double shift_x_um = 0, shift_y_um = 0, turn_urad = 0, scale_ppm = 0;
};

/// Moves the image and adds the column frame_id.
inline void MoveCamera(const std::vector<FrameAt>& frames, Campaign* campaign) {
  const Exposures exposures = FindExposures(*campaign);
  Covariate ids{.name = "frame_id", .values = {}};
  for (std::size_t row = 0; row < campaign->rows(); ++row) {
    std::size_t k = 0;
    while (exposures.of_row[row] >= frames[k].until) ++k;
    ids.values.push_back(frames[k].id);
    const double x = campaign->x_mm[row], y = campaign->y_mm[row];
    const double turn = 1e-6 * frames[k].turn_urad, scale = 1 + 1e-6 * frames[k].scale_ppm;
    campaign->x_mm[row] = scale * (std::cos(turn) * x - std::sin(turn) * y);
    campaign->y_mm[row] = scale * (std::sin(turn) * x + std::cos(turn) * y);
    campaign->x_mm[row] += 1e-3 * frames[k].shift_x_um;
    campaign->y_mm[row] += 1e-3 * frames[k].shift_y_um;
  }
  campaign->covariates.push_back(std::move(ids));
}

}  // namespace focalfleet::sim::test
