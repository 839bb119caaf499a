// fiducials.csv: lights at known places of the plate, by which the camera is solved.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// At least three fiducials: fewer do not solve a camera. Errors: kInvalid with file:line: a column
/// or value missing, a fiducial twice, two at one place, more than limits::kFiducials, fewer than
/// three.
Result<std::vector<Fiducial>> ReadFiducials(std::string_view text, std::string file);

std::string WriteFiducials(std::span<const Fiducial> fiducials);

}  // namespace focalfleet
