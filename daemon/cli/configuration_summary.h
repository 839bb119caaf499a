// How a configuration went, as the daemon tells it: for people, for programs, and as an exit code.
#pragma once

#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// One line per fact, the units that were not served last, each with its reason.
std::string DescribeConfiguration(const Json& configuration, bool colour_on);

/// Of a progress line: its state, and what it waits for.
std::string DescribeStage(const Json& progress);

/// Only those units, by reason: reasons that differ in numbers alone are one. None: "". A stop of
/// all is no reason of a unit: units that it cut short are counted in the summary alone.
std::string DescribeNotServed(const Json& configuration);

/// `focalfleet apply --wait --json`: the keys of docs/cli.md, always all of them. `status` fills in
/// what a configuration does not say of itself (units of the fleet, bus load).
Json ApplySummary(const Json& configuration, const Json& status);

/// kOk where every unit that was asked for is known to be served; kSomeUnserved; kBroken where the
/// configuration was stopped or failed.
ExitCode ExitCodeOf(const Json& configuration);

}  // namespace focalfleet::cli
