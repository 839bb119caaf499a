// The camera's port as the configuration has it.
#pragma once

#include <memory>

#include "daemon/camera/camera_port.h"
#include "daemon/process/config.h"
#include "daemon/status/dds_troubles.h"

namespace focalfleet {

/// A camera over DDS or in a folder. Troubles of DDS go to `troubles`, which outlives the port.
/// Errors: those of CameraFolder::Open. Pre: there is a camera.
Result<std::unique_ptr<CameraPort>> OpenCameraPort(const DaemonConfig& config, SensorLimits sensor,
                                                   DdsTroubles* troubles);

}  // namespace focalfleet
