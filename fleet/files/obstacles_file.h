// obstacles.csv: the fixed things on the plate (fiducials, guide cameras, the plate's edge), as
// circles.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The obstacles; a header without rows is a plate without any. Errors: kInvalid with file:line: a
/// column or value missing, a negative radius, an obstacle twice.
Result<std::vector<Obstacle>> ReadObstacles(std::string_view text, std::string file);

std::string WriteObstacles(std::span<const Obstacle> obstacles);

}  // namespace focalfleet
