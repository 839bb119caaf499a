// CheckFitsStructure checks the skeleton of a FITS file: headers that end, sizes that are numbers,
// data that are complete. The library cfitsio trusts the mandatory cards of a header. With one of
// them broken it sizes arrays by undefined memory. The cards are therefore checked against the
// standard before cfitsio sees them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

inline constexpr std::size_t kFitsBlockBytes = 2880;

/// Checks all units with a header; bytes behind the last unit are not read.
/// Errors: kInvalid: no FITS file, a header that does not end or lacks a mandatory card in its
/// place, or data that are cut short. The text names the unit, from 0, after `name`.
Status CheckFitsStructure(std::string_view bytes, const std::string& name);

}  // namespace focalfleet
