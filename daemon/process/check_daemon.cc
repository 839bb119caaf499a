// `focalfleetd --check`: the configuration and its files are read, and nothing is opened for work.

#include "daemon/process/control_door.h"
#include "daemon/process/daemon.h"
#include "daemon/process/fleet_setup.h"
#include "daemon/process/http_door.h"
#include "daemon/process/plane_daemon.h"

namespace focalfleet {

Result<std::string> CheckDaemon(const DaemonConfig& config) {
  if (config.plane.coordinates()) {
    FOCALFLEET_TRY_ASSIGN(const PlaneLayout plane, LoadPlane(config));
    FOCALFLEET_TRY(FindRoles(config.control));
    FOCALFLEET_TRY(CheckHttpDoor(config.http));
    if (config.camera.present()) FOCALFLEET_TRY(LoadCameraSite(config.camera));
    return "# " + std::to_string(plane.layout().size()) + " units in " +
           std::to_string(plane.sectors()) + " sectors\n" + EffectiveConfig(config);
  }
  FOCALFLEET_TRY_ASSIGN(const Layout layout, LoadOwnLayout(config));
  FOCALFLEET_TRY(FindRoles(config.control));
  FOCALFLEET_TRY(CheckHttpDoor(config.http));
  FOCALFLEET_TRY(CheckInterfaces(config, layout));
  if (config.camera.present()) FOCALFLEET_TRY(LoadCameraSite(config.camera));
  FOCALFLEET_TRY(OpenFibreCarriers(config.hall, layout));
  return "# " + std::to_string(layout.size()) + " units on " +
         std::to_string(layout.buses().size()) + " buses\n" + EffectiveConfig(config);
}

}  // namespace focalfleet
