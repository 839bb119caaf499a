// These functions turn the daemon's report on a configuration into text, into JSON and into an exit
// code.
#pragma once

#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// The report as text: one line per fact. Units that were not served come last, each with its
/// reason.
std::string DescribeConfiguration(const Json& configuration, bool colour_on);

/// The stage in a progress line: its state, and what it waits for.
std::string DescribeStage(const Json& progress);

/// The units that were not served, by reason: reasons that differ in numbers alone are one. Empty
/// where all were served. A stop of all is no reason of a unit: units that it cut short are counted
/// in the summary alone.
std::string DescribeNotServed(const Json& configuration);

/// The JSON of `focalfleet apply --wait --json`: the keys of docs/cli.md, always all of them.
/// `status` supplies what a configuration does not state of itself (units of the fleet, bus load).
Json ApplySummary(const Json& configuration, const Json& status);

/// The exit code: kOk where every unit that was asked for is known to be served; kSomeUnserved;
/// kBroken where the configuration was stopped or failed.
ExitCode ExitCodeOf(const Json& configuration);

}  // namespace focalfleet::cli
