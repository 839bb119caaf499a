#include "daemon/report/pack.h"

#include <bit>
#include <cstddef>
#include <unordered_map>
#include <vector>

namespace focalfleet::report {
namespace {

constexpr std::size_t kByteIndexed = 256;
constexpr std::size_t kShortIndexed = 65'536;

using Bytes = std::vector<std::uint8_t>;

void Append(std::uint64_t number, std::size_t bytes, Bytes* out) {
  for (std::size_t k = 0; k < bytes; ++k) {
    out->push_back(static_cast<std::uint8_t>(number >> (8 * k)));
  }
}

}  // namespace

std::string Base64(std::span<const std::uint8_t> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = (group << 8U) | (at + k < bytes.size() ? bytes[at + k] : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const bool padding = at + k > bytes.size();
      out += padding ? '=' : kDigits[(group >> (18 - 6 * k)) & 63U];
    }
  }
  return out;
}

nlohmann::json PackColumn(std::span<const double> column) {
  std::unordered_map<std::uint64_t, std::size_t> place;
  std::vector<std::size_t> indices;
  Bytes distinct;
  Bytes all;
  for (const double value : column) {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    const auto [entry, is_new] = place.emplace(bits, place.size());
    if (is_new) Append(bits, sizeof bits, &distinct);
    indices.push_back(entry->second);
    Append(bits, sizeof bits, &all);
  }
  if (place.size() == 1) return {{"values", Base64(distinct)}};
  const std::size_t index_bytes = place.size() <= kByteIndexed ? 1 : 2;
  const bool shorter = distinct.size() + index_bytes * indices.size() < all.size();
  if (place.size() > kShortIndexed || !shorter) return {{"values", Base64(all)}};
  Bytes index;
  for (const std::size_t i : indices) Append(i, index_bytes, &index);
  return {{"values", Base64(distinct)}, {"indices", Base64(index)}};
}

}  // namespace focalfleet::report
