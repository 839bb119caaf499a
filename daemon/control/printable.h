// Texts of others before they reach a log or a terminal. A newline would forge a line, an escape
// sequence would move the cursor, hide or rename what stands elsewhere on the screen.
#pragma once

#include <string>
#include <string_view>

namespace focalfleet {

/// As one line that is nothing but text: control characters, bytes that are not UTF-8 and marks
/// that turn the direction of writing become `\n`, `\x1b`, `\u202e`. All else stays.
std::string Printable(std::string_view text);

/// As Printable, but newlines stay: for texts that have several lines of their own.
std::string PrintableLines(std::string_view text);

/// JSON as it is written out, with the same value: what it holds of such characters is escaped.
/// Pre: valid UTF-8.
std::string PrintableJson(std::string_view json);

}  // namespace focalfleet
