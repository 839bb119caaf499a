// A cell of a table: what its text means, and how it is shown to people.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace focalfleet {

/// Without blanks and tabs around it.
std::string_view Trimmed(std::string_view text);

/// A cell that may hold anything, as a person can read it: quoted, its first 40 bytes.
std::string Quoted(std::string_view cell);

// Pre: the cell is Trimmed.
bool IsMissing(std::string_view cell);                     // empty or nan
std::optional<double> ParseNumber(std::string_view cell);  // may be infinite
std::optional<bool> ParseFlagWord(std::string_view cell);  // true, false, T, F; any capitals

enum class CellKind : std::uint8_t { kMissing, kNumber, kFlag, kWord };
/// The kind of a cell in a column that nobody knows; `inf` is no number here.
CellKind KindOf(std::string_view cell);

}  // namespace focalfleet
