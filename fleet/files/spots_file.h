// spots.csv: one exposure of the fibre-view camera. Two comment lines give its id and time,
//
//   # exposure_id: 20261122-0041
//   # taken_utc: 2026-11-22T03:04:05.678Z
//   spot_id,x_px,y_px,flux,fwhm_px
//
// then follows one row a spot. `fwhm_px` may be left out. The content is not trusted before it has
// been checked: the reader makes the checks of CheckSpots, with the line.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "fleet/camera/spots.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The id may be used. Errors: kInvalid: empty, longer than limits::kExposureIdBytes, control
/// characters (the id stands in logs).
Status CheckExposureId(std::string_view id);

/// The checked exposure. Errors: kInvalid with file:line: a key or column missing or twice, an
/// empty or overlong id, a time that is none, a value that is not finite or out of range, a spot
/// twice, too many spots.
Result<Exposure> ReadSpots(std::string_view text, std::string file, const SensorLimits& sensor);

/// The text reads back as the same exposure; fwhm_px is left out where no spot has one.
std::string WriteSpots(const Exposure& exposure);

/// Nanoseconds of an ISO 8601 time in UTC, `2026-11-22T03:04:05.678Z`, with up to nine digits of a
/// second; the Z may be left out (FITS does). Years 1970 to 2262. Empty: not such a time.
std::optional<std::int64_t> UnixNsOf(std::string_view utc);
/// The time with as many digits as it needs, at least three. Pre: unix_ns >= 0.
std::string UtcOf(std::int64_t unix_ns);

}  // namespace focalfleet
