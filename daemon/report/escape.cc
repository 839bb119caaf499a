#include "daemon/report/escape.h"

#include <algorithm>

#include "protocol/base/utf8.h"

namespace focalfleet::report {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD

bool AllowedInXml(char32_t code) {
  if (code < 0x20) return code == '\t' || code == '\n' || code == '\r';
  const bool control = code >= 0x7F && code < 0xA0;  // allowed in XML, an error in HTML5
  return !control && (code & 0xFFFEU) != 0xFFFEU && !(code >= 0xFDD0 && code <= 0xFDEF);
}

}  // namespace

std::string EscapeMarkup(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character character = FirstCharacter(text);
    const std::string_view bytes = text.substr(0, character.bytes);
    text.remove_prefix(character.bytes);
    if (!character.valid || !AllowedInXml(character.code)) {
      out += kReplacement;
    } else if (bytes == "&") {
      out += "&amp;";
    } else if (bytes == "<") {
      out += "&lt;";
    } else if (bytes == ">") {
      out += "&gt;";
    } else if (bytes == "\"") {
      out += "&quot;";
    } else if (bytes == "'") {
      out += "&#39;";
    } else {
      out += bytes;
    }
  }
  return out;
}

std::size_t CountCharacters(std::string_view text) {
  std::size_t count = 0;
  for (; !text.empty(); ++count) text.remove_prefix(FirstCharacter(text).bytes);
  return count;
}

std::string Shorten(std::string_view text, std::size_t characters_max) {
  if (CountCharacters(text) <= characters_max) return std::string(text);
  std::size_t bytes = 0;
  for (std::size_t kept = 1; kept < characters_max; ++kept) {
    bytes += FirstCharacter(text.substr(bytes)).bytes;
  }
  return std::string(text.substr(0, bytes)) + "\xE2\x80\xA6";
}

}  // namespace focalfleet::report
