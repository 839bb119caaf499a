#include "daemon/control/printable.h"

#include <array>
#include <cstdint>
#include <cstdio>

#include "protocol/base/utf8.h"

namespace focalfleet {
namespace {

bool IsControl(char32_t code) {
  const bool c0_or_c1 = code < 0x20 || (code >= 0x7f && code < 0xa0);
  const bool line_or_direction = code == 0x061c || code == 0x200e || code == 0x200f ||
                                 (code >= 0x2028 && code <= 0x202e) ||
                                 (code >= 0x2066 && code <= 0x2069);
  return c0_or_c1 || line_or_direction;
}

enum class As : std::uint8_t { kLine, kLines, kJson };

void AppendEscape(char32_t code, As as, std::string* out) {
  const char letter = code == '\n' ? 'n' : code == '\r' ? 'r' : code == '\t' ? 't' : '\0';
  std::array<char, 16> escape;
  const int length = letter != '\0' ? std::snprintf(escape.data(), escape.size(), "\\%c", letter)
                     : code < 0x100 && as != As::kJson
                         ? std::snprintf(escape.data(), escape.size(), "\\x%02x", unsigned{code})
                         : std::snprintf(escape.data(), escape.size(), "\\u%04x", unsigned{code});
  out->append(escape.data(), static_cast<std::size_t>(length));
}

std::string Cleaned(std::string_view text, As as) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    if (!first.valid)
      AppendEscape(static_cast<unsigned char>(text[0]), as, &out);
    else if (IsControl(first.code) && !(as == As::kLines && first.code == '\n'))
      AppendEscape(first.code, as, &out);
    else
      out.append(text.substr(0, first.bytes));
    text.remove_prefix(first.bytes);
  }
  return out;
}

}  // namespace

std::string Printable(std::string_view text) { return Cleaned(text, As::kLine); }
std::string PrintableLines(std::string_view text) { return Cleaned(text, As::kLines); }
std::string PrintableJson(std::string_view json) { return Cleaned(json, As::kJson); }

}  // namespace focalfleet
