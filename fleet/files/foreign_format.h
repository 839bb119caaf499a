// Files that users pass where a text is expected, recognised by their first bytes: tables of
// astronomy, compressed files, spreadsheets, text in another encoding. The message for each says
// what it is and what to do; "not a text file: byte 0x1f" would not help.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace focalfleet {

/// The message. Empty: it may be text in UTF-8. Cost: looks at the first kilobyte and the last four
/// bytes.
std::optional<std::string> ForeignFormat(std::string_view bytes);

}  // namespace focalfleet
