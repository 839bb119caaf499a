// Verbs are the requests that a running simulation serves on its control socket: they report the
// truth and plant faults.
//   truth {targets_csv?, targets_name?}   status {}   quit {}
//   power_cut {units, seconds?}   power_on {units}   fault {units, code, axis?, after_s?}
//   silence {units, off?}   kill_bus {buses}   revive_bus {buses}
//   camera {fault, exposures?}: the fault of the next exposures; `none` ends it
//   misbehave {units, off?, late_s?, copies?, deaf?, wrong_digest?, mute_done?, foreign_serial?}:
//     adds to the faults that the units already have; `off` ends all that this verb began before
#pragma once

#include <vector>

#include "daemon/control/messages.h"
#include "daemon/simulator/camera_door.h"
#include "protocol/base/instants.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

class Verbs {
 public:
  /// `camera`: null where there is none.
  explicit Verbs(sim::World* world, CameraDoor* camera = nullptr)
      : world_(world), camera_(camera) {}

  /// Serves one request. Pre: the world has been advanced to the present.
  Result<Json> Do(const ControlRequest& request);
  /// Restores power that is due to come back.
  void Tick(HostInstant now);
  [[nodiscard]] HostInstant wake_at() const;
  [[nodiscard]] bool quit() const { return quit_; }

 private:
  Result<Json> Truth(const Json& args);
  Result<Json> PowerCut(const Json& args);
  Result<Json> PowerOn(const Json& args);
  Result<Json> RaiseFault(const Json& args);
  Result<Json> Silence(const Json& args);
  Result<Json> Misbehave(const Json& args);
  Result<Json> SetBuses(const Json& args, bool alive);
  Result<Json> FailCamera(const Json& args);
  [[nodiscard]] Json StatusOfAll() const;
  /// The units that the request names. If any does not exist, the request is an error and none is
  /// touched.
  [[nodiscard]] Result<std::vector<UnitId>> Units(const Json& args) const;

  struct PowerReturn {
    HostInstant at;
    UnitId unit;
  };
  sim::World* world_;
  CameraDoor* camera_;
  std::vector<PowerReturn> power_returns_;
  bool quit_ = false;
};

}  // namespace focalfleet::simulator
