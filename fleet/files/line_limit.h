// A limit on the lines of a table, checked before it is read. Every cell takes some hundred bytes
// of memory, so a small file of very many lines takes gigabytes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid: more lines than that, comments and empty ones included.
inline Status CheckLines(std::string_view text, const std::string& file, std::size_t lines_max) {
  const auto lines = static_cast<std::size_t>(std::ranges::count(text, '\n'));
  if (lines <= lines_max) return {};
  return Fail(ErrorCode::kInvalid, file + ": " + std::to_string(lines) + " lines are more than " +
                                       std::to_string(lines_max));
}

}  // namespace focalfleet
