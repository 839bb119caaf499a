// Objects that the daemon makes of its configuration: the layout out of its files, the camera's
// site, one port a bus, the SYNC line.
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

/// The layout of this daemon: that of the units file, or of its sector's buses in it. Errors: as
/// LoadLayout; kInvalid with file:line: a bus that the units file has not.
Result<Layout> LoadOwnLayout(const DaemonConfig& config);

/// The configured camera with its fiducials. Pre: a camera is configured. Errors: as LoadLayout.
Result<CameraSite> LoadCameraSite(const DaemonConfig::Camera& camera);

/// The worker that makes places of the readings of the units' own sensors; none where [hall] has no
/// model.
/// Errors: as LoadLayout; kInvalid: a set of sensors that the model does not fit.
Result<std::unique_ptr<FibreCarrierWorker>> OpenFibreCarriers(const DaemonConfig::Hall& hall,
                                                              const Layout& layout);

/// Configuration and layout have the same number of buses, where the port is SocketCAN.
/// Errors: kInvalid: not one interface a bus.
Status CheckInterfaces(const DaemonConfig& config, const Layout& layout);

/// The ports, one a bus, in the order of layout.buses(). A bus that is absent is down, which
/// concerns its own units only; the port tries to open it again. Errors: kInvalid: not one
/// interface a bus; kUnavailable: none of the interfaces is there.
Result<std::vector<std::unique_ptr<PollablePort>>> OpenPorts(
    const DaemonConfig& config, const Layout& layout, const HostClock& clock,
    const InterfaceOpener& open = OpenInterface);

/// The SYNC line; none where the configuration has no [sync] chip. Errors: kUnavailable with
/// file:line: the chip or line is absent, or in use.
Result<std::unique_ptr<SyncLine>> OpenSync(const DaemonConfig::Sync& sync,
                                           GpioKernel& kernel = RealGpioKernel());

}  // namespace focalfleet
