// The versions of this command line and of the daemon. Both are one program in two parts, so they
// should agree; after an upgrade they differ until the daemon starts anew.
#pragma once

#include <optional>
#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// The version of this program.
const char* ClientVersion();

/// The version of the daemon that answers at the socket within two seconds; none: nobody does.
std::optional<std::string> DaemonVersion(const Context& context);

/// A sentence where the daemon's version is another; empty where both agree.
std::string DifferenceFrom(const std::string& daemon_version);

}  // namespace focalfleet::cli
