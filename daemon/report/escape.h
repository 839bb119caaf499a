// EscapeMarkup makes text safe for markup. Names of units, files and claims come from outside and
// may hold anything. After escaping they can neither open a tag nor make the page unreadable to a
// strict parser. Such a parser rejects bytes that are not UTF-8 and most control characters.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace focalfleet::report {

/// The text, safe between tags and inside quoted attributes. & < > " ' become entities. Each byte
/// that is not UTF-8, and each character that XML 1.0 does not allow, becomes U+FFFD.
std::string EscapeMarkup(std::string_view text);

/// The number of code points in valid UTF-8; each other byte counts as one.
std::size_t CountCharacters(std::string_view text);

/// At most `characters_max` characters of the text, the last of them an ellipsis where something
/// was cut.
std::string Shorten(std::string_view text, std::size_t characters_max);

}  // namespace focalfleet::report
