// The skeleton of a FITS file: headers that end, sizes that are numbers, data that are all there.
// cfitsio believes the mandatory cards of a header: with one of them broken it makes arrays by
// whatever stood in its memory. So they are held against the standard before it sees them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

inline constexpr std::size_t kFitsBlockBytes = 2880;

/// Checks all units with a header; bytes behind the last of them are not looked at. Errors:
/// kInvalid: no FITS file, a header that does not end or lacks a mandatory card in its place, data
/// that are cut short; names the unit, from 0, after `name`.
Status CheckFitsStructure(std::string_view bytes, const std::string& name);

}  // namespace focalfleet
