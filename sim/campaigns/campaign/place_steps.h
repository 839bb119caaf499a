// How fine a campaign's places are. A camera that tells whole pixels, or a table with few digits,
// gives places in steps: the error of a coordinate is then spread evenly over one step, and no
// estimate from places that repeat can be below that. Whoever divides by a noise needs a floor.
#pragma once

#include <span>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// A coordinate in double precision, in mm on a plate of 1 m, is rounded by less than 1e-7 um; no
/// camera and no model of a positioner is as good as this. Half of it changes nothing; double of it
/// would be seen in a campaign that is simulated without noise.
inline constexpr double kNoiseLeast_um = 0.02;

/// The widest step that nearly all of the values are whole multiples of, apart from a common
/// offset; 0: none that is more than chance. Values that are not finite say nothing.
double FindStep(std::span<const double> values);

/// The place of the last digit that any of the values has, 1 at most; 0: they have more digits than
/// 1e-6 shows, or there are none.
double LastDigitOf(std::span<const double> values);

struct PlaceSteps {
  double x_mm = 0;  // 0: none was found
  double y_mm = 0;
  [[nodiscard]] double wider_mm() const { return x_mm > y_mm ? x_mm : y_mm; }
};
PlaceSteps FindPlaceSteps(const Campaign& campaign);

/// Standard deviation of what a step rounds off: uniform over the step.
double SpreadOfStep(double step);

/// Below this no standard deviation of a coordinate is believed: that of the wider step, that of
/// the digits of sigma_um where it is told, and kNoiseLeast_um.
double LeastNoise_um(const Campaign& campaign, const PlaceSteps& steps);

}  // namespace focalfleet::sim
