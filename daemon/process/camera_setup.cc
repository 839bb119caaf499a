#include "daemon/process/camera_setup.h"

#include <string>

#include "daemon/camera/camera_dds.h"
#include "daemon/camera/camera_folder.h"
#include "daemon/process/dds_setup.h"

namespace focalfleet {

Result<std::unique_ptr<CameraPort>> OpenCameraPort(const DaemonConfig& config, SensorLimits sensor,
                                                   DdsTroubles* troubles) {
  if (config.camera.dds)
    return std::make_unique<CameraDds>(
        CameraDds::Options{.dds = DdsOptionsOf(config.dds),
                           .sensor = sensor,
                           .tell = [troubles](const std::string& trouble) {
                             troubles->Report(AlarmName::kCameraDdsMissing, "the camera", trouble);
                           }});
  return CameraFolder::Open(
      config.camera.directory, sensor,
      config.camera.drop_place ? CameraFolder::Place::kDropPlace : CameraFolder::Place::kFolder);
}

}  // namespace focalfleet
