#include "tests/daemon/report/unpack.h"

#include <bit>
#include <string_view>

namespace focalfleet::report::test {
namespace {

std::uint64_t LittleEndian(const std::vector<std::uint8_t>& bytes, std::size_t at,
                           std::size_t size) {
  std::uint64_t number = 0;
  for (std::size_t k = size; k-- > 0;) number = number * 256 + bytes.at(at + k);
  return number;
}

std::vector<std::uint64_t> Numbers(const std::vector<std::uint8_t>& bytes, std::size_t size) {
  std::vector<std::uint64_t> numbers;
  for (std::size_t at = 0; at < bytes.size(); at += size) {
    numbers.push_back(LittleEndian(bytes, at, size));
  }
  return numbers;
}

}  // namespace

std::vector<std::uint8_t> FromBase64(const std::string& text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  std::uint32_t bits = 0;
  int have = 0;
  for (const char c : text.substr(0, text.find('='))) {
    const std::size_t digit = kDigits.find(c);
    if (text.size() % 4 != 0 || digit == std::string_view::npos) return {};
    bits = (bits << 6U) | static_cast<std::uint32_t>(digit);
    have += 6;
    if (have < 8) continue;
    have -= 8;
    bytes.push_back(static_cast<std::uint8_t>(bits >> have));
    bits &= (1U << have) - 1;
  }
  return bytes;
}

std::vector<std::uint64_t> UnpackBits(const nlohmann::json& packed, std::size_t count) {
  const auto values = Numbers(FromBase64(packed.at("values").get<std::string>()), 8);
  if (packed.contains("indices")) {
    std::vector<std::uint64_t> column;
    const std::size_t size = values.size() <= 256 ? 1 : 2;
    for (const auto i : Numbers(FromBase64(packed.at("indices").get<std::string>()), size)) {
      column.push_back(values.at(i));
    }
    return column;
  }
  return values.size() == 1 ? std::vector<std::uint64_t>(count, values[0]) : values;
}

std::vector<double> Unpack(const nlohmann::json& packed, std::size_t count) {
  std::vector<double> column;
  for (const std::uint64_t bits : UnpackBits(packed, count)) {
    column.push_back(std::bit_cast<double>(bits));
  }
  return column;
}

}  // namespace focalfleet::report::test
