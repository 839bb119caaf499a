// ParseSpotsFits reads one exposure from a FITS binary table. Its columns are SPOT_ID, X_PX, Y_PX,
// FLUX and perhaps FWHM_PX. Its keys EXPID and DATE-OBS give what `# exposure_id` and `# taken_utc`
// give in spots.csv.
//
// The first table with these columns is read. Other columns of it are ignored, and so are images
// and tables before it. Keys may stand in the primary header; EXPID may be a whole number.
#pragma once

#include <string>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The exposure in a file's bytes, as ReadSpots gives it.
/// Errors: kInvalid; names `name` and the column, key or row.
Result<Exposure> ParseSpotsFits(std::string bytes, const std::string& name,
                                const SensorLimits& sensor);

Status WriteSpotsFits(const std::string& path, const Exposure& exposure);

}  // namespace focalfleet
