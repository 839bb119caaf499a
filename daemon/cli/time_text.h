// Times as operators write them: `2h` for a span, or before now for an instant; otherwise a date
// and a time of UTC, as all answers show them.
#pragma once

#include <string>

#include "daemon/clock/wall_time.h"
#include "protocol/base/result.h"

namespace focalfleet::cli {

/// The seconds of `90s`, `30m`, `2h` or `7d`; a number alone is seconds. Errors: kInvalid: no such
/// text, not above 0, or above 100 years.
Result<double> SecondsOf(const std::string& text);

/// The instant of `2026-11-26T15:00:30Z` (seconds and Z may be left out, a blank may stand for T),
/// of `2026-11-26`, or of a span before `now`. Errors: kInvalid.
Result<WallTime> InstantOf(const std::string& text, WallTime now);

}  // namespace focalfleet::cli
