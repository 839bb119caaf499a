// DirectStop stops units without a daemon. The buses are those that the daemon's configuration
// names. They are opened beside the daemon, and each gets the stop frame. Stop has the lowest
// identifier of all, so it wins against all frames of a faulty daemon. The frame is sent three
// times, because no program is left to repeat it. Units answer with their position; answers are
// counted, but not waited for longer than a second.
//
// Only [bus] and, for a single unit, [fleet] units are read. An error elsewhere in the file
// therefore cannot prevent the stop.
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
  std::optional<UnitId> unit;  // empty: all units
};

struct DirectStopBus {
  std::string name;  // interface or socket
  bool sent = false;
  std::string trouble;  // reason where no stop was sent
  std::uint32_t units_answered = 0;
};

/// Sends the stops. The result has one row per bus, in the order of the configuration. Takes up to
/// a second of waiting for answers.
/// Errors: kInvalid, kUnavailable: the configuration cannot be used; names file and reason.
Result<std::vector<DirectStopBus>> DirectStop(const DirectStopRequest& request);

}  // namespace focalfleet::cli
