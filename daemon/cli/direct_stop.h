// The stop that needs no daemon: opens the buses that the daemon's configuration names, beside it,
// and puts the stop frame on each. Stop has the lowest identifier of all, so it wins against
// whatever a daemon that has gone wrong still sends. It is sent three times, because nobody is left
// who would ask again; units answer with where they stand, which is counted but not waited for
// longer than a second.
//
// Only [bus] and, for a single unit, [fleet] units are read, so that an error elsewhere in the file
// cannot stand between an operator and the stop.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/result.h"

namespace focalfleet::cli {

struct DirectStopRequest {
  std::string config;          // the daemon's TOML file
  std::optional<UnitId> unit;  // none: all
};

struct DirectStopBus {
  std::string name;  // interface or socket
  bool sent = false;
  std::string trouble;  // why not
  std::uint32_t units_answered = 0;
};

/// One row per bus, in the order of the configuration. Takes up to a second of waiting for answers.
/// Errors: kInvalid, kUnavailable: the configuration cannot be used; names file and reason.
Result<std::vector<DirectStopBus>> DirectStop(const DirectStopRequest& request);

}  // namespace focalfleet::cli
