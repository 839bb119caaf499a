// The reverse of pack.h for tests, written from what its header states, with a base64 of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace focalfleet::report::test {

/// Returns the bytes; empty where the text is no base64 of whole groups.
std::vector<std::uint8_t> FromBase64(const std::string& text);

/// Returns the bits of each number.
std::vector<std::uint64_t> UnpackBits(const nlohmann::json& packed, std::size_t count);
std::vector<double> Unpack(const nlohmann::json& packed, std::size_t count);

}  // namespace focalfleet::report::test
