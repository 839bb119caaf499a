// ParseExposure reads an exposure as a camera delivers it: spots.csv or a FITS table, either of
// them perhaps packed by gzip. The first bytes decide the format, whatever the file is called.
#pragma once

#include <string>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The exposure in `bytes`.
/// Errors: kInvalid, with `name` in front: as those of ReadSpots, ParseSpotsFits, CheckText and
/// Gunzip (at most limits::kExposureBytes).
Result<Exposure> ParseExposure(std::string bytes, const std::string& name,
                               const SensorLimits& sensor);

}  // namespace focalfleet
