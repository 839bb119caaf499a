// A command of several units that the daemon takes one by one: adopt, params, retarget, history.
// Every unit is asked for, whatever the daemon answers for those before it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "daemon/cli/client.h"

namespace focalfleet::cli {

/// A question of which each unit gets a copy, with its unit_id.
struct UnitQuestion {
  std::string verb;
  Json args = Json::object();
  bool long_lasting = false;
  /// Tells people of the answer for a unit, and may add members to what --json shows. False: the
  /// answer says that the unit was not served.
  std::function<bool(std::uint32_t unit_id, Json* answer)> tell;
};

/// Asks for each unit in turn. A refusal is reported with its unit, and the others are asked for
/// all the same; only a daemon that does not answer ends it, after what is known so far. With
/// --json a single unit is the daemon's answer; several are {units: [answer + unit_id], refused:
/// [{unit_id, code, text}]}. Returns kOk; kSomeUnserved where some units were refused; the code of
/// the first refusal where all were.
ExitCode AskForEach(const Context& context, const std::vector<std::uint32_t>& units,
                    const UnitQuestion& question);

}  // namespace focalfleet::cli
