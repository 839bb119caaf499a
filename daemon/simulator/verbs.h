// What a running simulation does when asked on its control socket: tells the truth, and plants
// misfortune.
//   truth {targets_csv?, targets_name?}   status {}   quit {}
//   power_cut {units, seconds?}   power_on {units}   fault {units, code, axis?, after_s?}
//   silence {units, off?}   kill_bus {buses}   revive_bus {buses}
//   camera {fault, exposures?}: how the next exposures go wrong; `none` ends it
//   misbehave {units, off?, late_s?, copies?, deaf?, wrong_digest?, mute_done?, foreign_serial?}:
//     adds to how the units already misbehave; `off` ends all that this verb began before
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

  /// Pre: the world has been brought to the present.
  Result<Json> Do(const ControlRequest& request);
  /// Power that comes back by itself.
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
  /// All of them exist, or none is touched.
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
