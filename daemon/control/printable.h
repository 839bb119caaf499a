// Texts from outside are cleaned here before they reach a log or a terminal. A newline would forge
// a line. An escape sequence would move the cursor, or hide or change other text on the screen.
#pragma once

#include <string>
#include <string_view>

namespace focalfleet {

/// The text as one line without control. Control characters, bytes that are not UTF-8 and marks
/// that turn the direction of writing become `\n`, `\x1b`, `\u202e`. All else stays.
std::string Printable(std::string_view text);

/// The same, but newlines stay: for texts of several lines.
std::string PrintableLines(std::string_view text);

/// JSON text of the same value, with such characters escaped. Pre: valid UTF-8.
std::string PrintableJson(std::string_view json);

}  // namespace focalfleet
