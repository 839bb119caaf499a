// An exposure as a camera hands it over: spots.csv or a FITS table, either of them perhaps packed
// by gzip. The first bytes decide, whatever the file is called.
#pragma once

#include <string>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid, after `name`: as those of ReadSpots, ParseSpotsFits, Gunzip (at most
/// limits::kExposureBytes) and CheckText.
Result<Exposure> ParseExposure(std::string bytes, const std::string& name,
                               const SensorLimits& sensor);

}  // namespace focalfleet
