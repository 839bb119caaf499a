// The characters of a text that may hold any bytes, one after the other. Bytes that are no UTF-8
// come one by one.
#pragma once

#include <cstddef>
#include <string_view>

namespace focalfleet {

struct Utf8Character {
  std::size_t bytes = 1;  // taken from the text, at least one
  char32_t code = 0;
  bool valid = false;  // false: one byte that is no UTF-8, and `code` is 0
};

/// The first character of any bytes. Overlong forms, surrogates and codes beyond U+10FFFF are not
/// valid. Pre: `text` is not empty.
constexpr Utf8Character FirstCharacter(std::string_view text) {
  constexpr char32_t kLeastOfLength[] = {0, 0, 0x80, 0x800, 0x10000};
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {1, lead, true};
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead >= 0xF5 || length > text.size()) return {};
  char32_t code = lead & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    code = (code << 6U) | (byte(i) & 0x3FU);
  }
  const bool surrogate = code >= 0xD800 && code < 0xE000;
  if (code < kLeastOfLength[length] || surrogate || code > 0x10FFFF) return {};
  return {length, code, true};
}

}  // namespace focalfleet
