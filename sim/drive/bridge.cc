#include "sim/drive/bridge.h"

namespace focalfleet::sim {

void Leg::FollowPath(const Bridge& bridge, double now_s) {
  slope_V_per_s = 0;
  ramp_ends_at_s = kNever;
  if (path == Path::kFloats) return;
  const bool to_upper = path == Path::kUpper || path == Path::kUpperDiode;
  const double target = to_upper ? bridge.v_bus_V : 0;
  const double way = target - voltage_V;
  const double whole_s = way > 0 ? bridge.rise_s : bridge.fall_s;
  if (way == 0 || whole_s == 0) {
    voltage_V = target;
    return;
  }
  slope_V_per_s = (way > 0 ? 1 : -1) * bridge.v_bus_V / whole_s;
  ramp_ends_at_s = now_s + way / slope_V_per_s;
}

}  // namespace focalfleet::sim
