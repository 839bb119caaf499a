// Bytes that gzip packed, unpacked in memory. A few kilobytes may stand for gigabytes, so the
// answer is limited, not the file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

bool IsGzip(std::string_view bytes);

/// All members of the file, one after the other. Errors: kInvalid, names `name`: cut short, wrong
/// checksum, no gzip, more than `bytes_max`.
Result<std::string> Gunzip(std::string_view bytes, const std::string& name, std::size_t bytes_max);

}  // namespace focalfleet
