#include "daemon/camera/exposure_bytes.h"

#include <utility>

#include "daemon/camera/spots_fits.h"
#include "daemon/files/gunzip.h"
#include "daemon/files/text_file.h"
#include "fleet/files/spots_file.h"
#include "protocol/base/limits.h"

namespace focalfleet {

Result<Exposure> ParseExposure(std::string bytes, const std::string& name,
                               const SensorLimits& sensor) {
  if (IsGzip(bytes)) {
    FOCALFLEET_TRY_ASSIGN(bytes, Gunzip(bytes, name, limits::kExposureBytes));
  }
  if (bytes.starts_with("SIMPLE  =")) return ParseSpotsFits(std::move(bytes), name, sensor);
  FOCALFLEET_TRY(CheckText(bytes, name));
  return ReadSpots(bytes, name, sensor);
}

}  // namespace focalfleet
