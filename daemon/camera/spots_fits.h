// One exposure as a FITS binary table: columns SPOT_ID, X_PX, Y_PX, FLUX and perhaps FWHM_PX, keys
// EXPID and DATE-OBS, which say what `# exposure_id` and `# taken_utc` say in spots.csv.
#pragma once

#include <string>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// As ReadSpots. Errors: kUnavailable, kInvalid; names file and column or key.
Result<Exposure> ReadSpotsFits(const std::string& path, const SensorLimits& sensor);

Status WriteSpotsFits(const std::string& path, const Exposure& exposure);

}  // namespace focalfleet
