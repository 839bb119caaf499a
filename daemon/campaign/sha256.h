// SHA-256 of text, by which a report says from which bytes it was made. Source: FIPS 180-4.
#pragma once

#include <string>
#include <string_view>

namespace focalfleet {

/// 64 hexadecimal digits.
std::string Sha256Hex(std::string_view bytes);

}  // namespace focalfleet
