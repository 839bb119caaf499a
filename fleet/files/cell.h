// A cell of a table: the meaning of its text, and its form in messages.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace focalfleet {

/// The text without blanks and tabs around it.
std::string_view Trimmed(std::string_view text);

/// The first 40 bytes of a cell with any content, quoted, in readable form.
std::string Quoted(std::string_view cell);

// Pre: the cell is Trimmed.
bool IsMissing(std::string_view cell);  // empty, nan, null, none, n/a, na, <na>, --, \N
std::optional<double> ParseNumber(std::string_view cell);  // may be infinite; Fortran's 1.5D3, too
std::optional<bool> ParseFlagWord(std::string_view cell);  // true, false, T, F; any capitals

enum class CellKind : std::uint8_t { kMissing, kNumber, kFlag, kWord };
/// The kind of a cell in an unknown column; `inf` is no number here.
CellKind KindOf(std::string_view cell);

}  // namespace focalfleet
