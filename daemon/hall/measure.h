// MeasureUnits does one ExposureJob with two instruments: units that can measure themselves use
// their own sensors, and the camera measures the rest. The camera is asked only where the sensors
// of a unit with a target do not find it exactly enough. Then both measure the unit, and the more
// exact of two certain positions counts.
#pragma once

#include <atomic>

#include "daemon/camera/camera_work.h"
#include "daemon/hall/fibre_carrier_work.h"

namespace focalfleet {

/// The measurements of one job. Either instrument may be null.
/// Errors in the answer: as the camera's, where no unit measured itself. Otherwise the findings
/// report the camera's trouble, and only the other units lack a measurement.
ExposureDone MeasureUnits(const CameraWork& work, FibreCarrierWorker* carriers,
                          CameraWorker* camera, const std::atomic<bool>& ending);

}  // namespace focalfleet
