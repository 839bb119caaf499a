// PackColumn packs columns of numbers for a page's script. Written as text, the digits of 5000
// units and their rows are megabytes. The bytes of the doubles in base64 are a third of that, and
// the script reads back the same doubles. Repeated values (arms, rails, powers) are stored once,
// with one index for each number:
//
//   {"values": B}                all values
//   {"values": B, "indices": I}  value k of the column is values[indices[k]]
//
// B is base64 of little-endian binary64. I is base64 of bytes, or of little-endian 16-bit integers
// where there are more than 256 values. A column with one value throughout has neither more values
// nor indices; the reader knows its length.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace focalfleet::report {

/// Base64 of RFC 4648, with padding, in one line.
std::string Base64(std::span<const std::uint8_t> bytes);

/// The column in the shortest of the three forms. Bits are kept, those of NaN and -0 too. Cost:
/// O(n).
nlohmann::json PackColumn(std::span<const double> column);

}  // namespace focalfleet::report
