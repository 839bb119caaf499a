// Names of interfaces as they stand on the command line of focalfleet-sim, such as vcan0...vcan49.
#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::simulator {

/// Whether the whole text is a number.
template <class Number>
bool Parse(std::string_view text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

/// Interface names in the order of the buses, from text such as "vcan0,vcan1" or "vcan0...vcan49".
/// Errors: kInvalid, names the piece.
Result<std::vector<std::string>> ParseInterfaces(const std::string& text);

}  // namespace focalfleet::simulator
