// The step of a campaign's places limits every estimate of their noise. A camera that reports whole
// pixels, or a table with few digits, gives places in steps. The error of a coordinate is then
// spread evenly over one step. An estimate from repeated places cannot be below that, and a
// division by the noise needs a floor.
#pragma once

#include <span>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// A coordinate in double precision, in mm on a plate of 1 m, is rounded by less than 1e-7 um. No
/// camera and no model of a positioner is as good as this floor. Half of it changes nothing. Twice
/// of it would be seen in a campaign that is simulated without noise.
inline constexpr double kNoiseLeast_um = 0.02;

/// The widest step of which nearly all values are whole multiples, apart from a common offset. 0
/// where chance explains every step. Values that are not finite are ignored.
double FindStep(std::span<const double> values);

/// The place of the last digit that any of the values has, 1 at most. 0 where the values have more
/// digits than 1e-6 shows, or where there are none.
double LastDigitOf(std::span<const double> values);

struct PlaceSteps {
  double x_mm = 0;  // 0: none was found
  double y_mm = 0;
  [[nodiscard]] double wider_mm() const { return x_mm > y_mm ? x_mm : y_mm; }
};
/// Those of the places as measured.
PlaceSteps FindPlaceSteps(const Campaign& campaign);

/// Standard deviation of the rounding to a step: the error is uniform over the step.
double SpreadOfStep(double step);

/// The least standard deviation of a coordinate that is believed. This floor is the largest of that
/// of the wider step, that of the digits of sigma_um where the table has this column, and
/// kNoiseLeast_um.
double LeastNoise_um(const Campaign& campaign, const PlaceSteps& steps);

}  // namespace focalfleet::sim
