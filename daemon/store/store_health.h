// The health of a store's file, found by reading alone. The daemon that writes it goes on
// meanwhile.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/clock/wall_time.h"
#include "daemon/store/store_options.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct StoreHealth {
  std::int32_t version = 0;
  std::int32_t version_expected = 0;  // of this program
  std::string flaw;                   // the first that SQLite finds; empty: none
  std::uint64_t bytes = 0;            // the file and its write-ahead log
  std::uint64_t motions = 0;
  std::uint64_t configurations = 0;
  std::optional<WallTime> since;  // the oldest configuration; none: the store has none
};

/// Errors: kUnavailable: no such file, or not readable; kNewer: written by a later version;
/// kInvalid: not a store. Cost: half a second for each million motions (SQLite's quick_check).
Result<StoreHealth> InspectHealth(const std::string& path, const StoreOptions& options = {});

}  // namespace focalfleet
