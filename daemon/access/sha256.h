// Sha256Hex is the SHA-256 of text. A report states by it from which bytes it was made. Source:
// FIPS 180-4.
#pragma once

#include <string>
#include <string_view>

namespace focalfleet {

/// The digest as 64 hexadecimal digits.
std::string Sha256Hex(std::string_view bytes);

}  // namespace focalfleet
