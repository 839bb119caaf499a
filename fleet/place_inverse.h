// The inverse of a model of where a fibre goes: the count of both axes at which the fibre is at a
// wanted point. The caller gives the model as a function. The inverse uses the unit's base and arms
// only, and finds the count by Newton's method with bounded steps.
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "fleet/geometry/segment.h"
#include "fleet/kinematics.h"

namespace focalfleet {

/// Where the model has the phi arm at this count: `a` is the elbow, `b` the fibre.
using PlaceModel = std::function<SegmentFp(const AxisAngles& count)>;

struct WantedPlace {
  PointFp fibre_fp;                         // where the fibre is to be
  AxisAngles guess;                         // a count that leads near there
  PointFp base_fp;                          // of the unit
  std::array<double, kAxisCount> arm_mm{};  // theta arm, phi arm
};

/// The count at which the model is at the wanted place, or near it. Not held to the axes' ranges.
/// None: the model is not finite, or its nearest count lies more than 30 degrees from the guess on
/// an axis. Error: below 0.5 um by the model where the fibre can get there. Elsewhere the count is
/// the best of those tried, never farther off than the guess. Cost: at most 12 calls of the model.
std::optional<AxisAngles> CountAt(const WantedPlace& wanted, const PlaceModel& model);

}  // namespace focalfleet
