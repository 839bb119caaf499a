// From the configuration to what the daemon works on: the layout out of its files, one port a bus.
#pragma once

#include <memory>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/hall/fibre_carrier_work.h"
#include "daemon/ports/gpio_line.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/ports/socketcan_port.h"
#include "daemon/process/config.h"
#include "fleet/camera/findings.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kUnavailable: a file cannot be read; kInvalid with file:line.
Result<Layout> LoadLayout(const DaemonConfig::Fleet& fleet);

/// The camera as configured, with its fiducials. Pre: there is one. Errors: as LoadLayout.
Result<CameraSite> LoadCameraSite(const DaemonConfig::Camera& camera);

/// Who makes places of what units' own sensors show; none where [hall] has no model.
/// Errors: as LoadLayout; kInvalid: a set of sensors that the model does not fit.
Result<std::unique_ptr<FibreCarrierWorker>> OpenFibreCarriers(const DaemonConfig::Hall& hall,
                                                              const Layout& layout);

/// What configuration and layout must agree on. Errors: kInvalid: not one interface a bus.
Status CheckInterfaces(const DaemonConfig& config, const Layout& layout);

/// In the order of layout.buses(). A bus that is not there is down, and takes only its units with
/// it; it is looked for again.
/// Errors: kInvalid: not one interface a bus; kUnavailable: none of the interfaces is there.
Result<std::vector<std::unique_ptr<PollablePort>>> OpenPorts(
    const DaemonConfig& config, const Layout& layout, const HostClock& clock,
    const InterfaceOpener& open = OpenInterface);

/// None where the configuration has no [sync] chip. Errors: kUnavailable with file:line: the chip
/// or line is not there, or in use.
Result<std::unique_ptr<SyncLine>> OpenSync(const DaemonConfig::Sync& sync,
                                           GpioKernel& kernel = RealGpioKernel());

}  // namespace focalfleet
