// Gunzip unpacks bytes that gzip packed, in memory. A few kilobytes may expand to gigabytes, so the
// limit applies to the result, not to the file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

bool IsGzip(std::string_view bytes);

/// The content of all members of the file, one after the other.
/// Errors: kInvalid, names `name`: cut short, wrong checksum, no gzip, more than `bytes_max`.
Result<std::string> Gunzip(std::string_view bytes, const std::string& name, std::size_t bytes_max);

}  // namespace focalfleet
