// Numbers as operators write many of them: `7,20-25`. All programs read and show unit and bus
// numbers so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

/// Numbers from text such as "1,2,5-9", in its order. Errors: kInvalid, names the piece; more than
/// 100,000 numbers.
Result<std::vector<std::uint32_t>> ParseRanges(const std::string& text);

/// The numbers as such a text, ascending and each once; after `pieces_max` pieces comes "...".
std::string DescribeRanges(std::vector<std::uint32_t> numbers, std::size_t pieces_max);

}  // namespace focalfleet
