// Columns of numbers on their way into a page's script. Text digits of 5000 units and their rows
// are megabytes; the bytes of the doubles in base64 are a third of that and are the same doubles on
// the other side. What repeats (arms, rails, powers) is stored once, with an index a number:
//
//   {"values": B}                all values
//   {"values": B, "indices": I}  value k of the column is values[indices[k]]
//
// B is base64 of little-endian binary64, I of bytes, or of little-endian 16-bit integers where
// there are more than 256 values. A column with one value for all has neither more values nor
// indices; how long it is the reader knows.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace focalfleet::report {

/// RFC 4648, with padding, in one line.
std::string Base64(std::span<const std::uint8_t> bytes);

/// In the shortest of the three forms; bits are kept, those of NaN and -0 too. Cost: O(n).
nlohmann::json PackColumn(std::span<const double> column);

}  // namespace focalfleet::report
