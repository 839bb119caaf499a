// fiducials.csv: lights at known places of the plate, by which the camera is solved.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid with file:line: a column or value missing, a fiducial twice, two at one place,
/// more than limits::kFiducials, fewer than three: a camera cannot be solved from them.
Result<std::vector<Fiducial>> ReadFiducials(std::string_view text, std::string file);

std::string WriteFiducials(std::span<const Fiducial> fiducials);

}  // namespace focalfleet
