// From the configuration to what the daemon works on: the layout out of its files, one port a bus.
#pragma once

#include <memory>
#include <vector>

#include "daemon/clock.h"
#include "daemon/config.h"
#include "daemon/ports/pollable_port.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kUnavailable: a file cannot be read; kInvalid with file:line.
Result<Layout> LoadLayout(const DaemonConfig::Fleet& fleet);

/// What configuration and layout must agree on. Errors: kInvalid: not one interface a bus.
Status CheckInterfaces(const DaemonConfig& config, const Layout& layout);

/// In the order of layout.buses(). Errors: kInvalid: not one interface a bus; kUnavailable names
/// the interface.
Result<std::vector<std::unique_ptr<PollablePort>>> OpenPorts(const DaemonConfig& config,
                                                             const Layout& layout,
                                                             const HostClock& clock);

}  // namespace focalfleet
