// Place of a row in messages. Tables of text have lines; a FITS table has only rows. The number of
// such a row, from 1, is negative, so that readers can carry either one in an int.
#pragma once

#include <string>

namespace focalfleet {

/// "line 12" or "row 12".
inline std::string LineOrRow(int line) {
  return line < 0 ? "row " + std::to_string(-line) : "line " + std::to_string(line);
}

/// "t.csv:12" or "t.fits: row 12".
inline std::string PlaceIn(const std::string& file, int line) {
  return line < 0 ? file + ": " + LineOrRow(line) : file + ":" + std::to_string(line);
}

}  // namespace focalfleet
