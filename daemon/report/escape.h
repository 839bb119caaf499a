// Text on its way into markup. Names of units, files and claims come from outside and may hold
// anything; after EscapeMarkup they can neither open a tag nor make the page unreadable to a strict
// parser, which rejects bytes that are not UTF-8 and most control characters.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace focalfleet::report {

/// Safe between tags and inside quoted attributes: & < > " ' as entities; each byte that is not
/// UTF-8, and each character that XML 1.0 does not allow, as U+FFFD.
std::string EscapeMarkup(std::string_view text);

/// Code points of valid UTF-8; other bytes count one each.
std::size_t CountCharacters(std::string_view text);

/// At most `characters_max` characters, the last of them an ellipsis where something was cut.
std::string Shorten(std::string_view text, std::size_t characters_max);

}  // namespace focalfleet::report
