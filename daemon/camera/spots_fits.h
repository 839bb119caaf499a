// One exposure as a FITS binary table: columns SPOT_ID, X_PX, Y_PX, FLUX and perhaps FWHM_PX, keys
// EXPID and DATE-OBS, which say what `# exposure_id` and `# taken_utc` say in spots.csv. The first
// table with these columns is meant; other columns of it, images and tables before it do not
// matter. Keys may stand in the primary header, EXPID may be a whole number.
#pragma once

#include <string>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// As ReadSpots, of a file's bytes. Errors: kInvalid; names `name` and column, key or row.
Result<Exposure> ParseSpotsFits(std::string bytes, const std::string& name,
                                const SensorLimits& sensor);

Status WriteSpotsFits(const std::string& path, const Exposure& exposure);

}  // namespace focalfleet
