// Files that people give where a text is wanted, known by their first bytes: tables of astronomy,
// compressed files, spreadsheets, text in another encoding. Each is told in a sentence that says
// what it is and what to do; "not a text file: byte 0x1f" helps nobody.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace focalfleet {

/// Nothing: it may be text in UTF-8. Cost: looks at the first kilobyte and the last four bytes.
std::optional<std::string> ForeignFormat(std::string_view bytes);

}  // namespace focalfleet
