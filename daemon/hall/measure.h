// One ExposureJob, done by whoever can: units that measure themselves by their own sensors, the
// rest by the camera. The camera is asked only where a unit that has a target is not found exactly
// enough by its own sensors; then both see it, and the more exact of two certain places counts.
#pragma once

#include <atomic>

#include "daemon/camera/camera_work.h"
#include "daemon/hall/fibre_carrier_work.h"

namespace focalfleet {

/// Either may be null. Errors of the answer: as the camera's, where no unit measured itself;
/// otherwise its trouble is told in the findings, and takes only the others away.
ExposureDone MeasureUnits(const CameraWork& work, FibreCarrierWorker* carriers,
                          CameraWorker* camera, const std::atomic<bool>& ending);

}  // namespace focalfleet
