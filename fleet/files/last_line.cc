#include "fleet/files/last_line.h"

#include <algorithm>

#include "fleet/files/place.h"

namespace focalfleet {

Status CheckLastLine(std::string_view text, const std::string& file) {
  if (text.empty() || text.ends_with('\n')) return {};
  const auto line = 1 + static_cast<int>(std::ranges::count(text, '\n'));
  return Fail(ErrorCode::kInvalid,
              PlaceIn(file, line) +
                  ": the last line does not end: the file is cut short (or end it with a newline)");
}

}  // namespace focalfleet
