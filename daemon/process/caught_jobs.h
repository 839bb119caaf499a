// The jobs of the planner's and the camera's thread, so that nothing in them ends the daemon.
// Memory may end in the libraries that a job uses, which then throw. A job that throws is an error
// of its configuration. A plan also has a limit of time.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string>

#include "daemon/camera/camera_work.h"
#include "daemon/hall/fibre_carrier_work.h"
#include "daemon/loop/event_loop.h"
#include "daemon/metrics/work_counters.h"

namespace focalfleet {

/// Limit of the time of one plan. The densest plate of 5000 units takes minutes. With half of the
/// limit a busy host might not finish such a plan. Twice as much would hold an operator up for
/// longer after a search that finds no end.
inline constexpr std::chrono::minutes kPlanWithin{15};

/// The plan, or the reason why there is none. `alive` is called while the search proceeds.
PlanDone PlanCaught(const PlannerWork& work, const Layout& layout, const std::atomic<bool>& ending,
                    const std::function<void()>& alive,
                    std::chrono::nanoseconds within = kPlanWithin);

/// The text of `state`; empty where memory ended.
std::string StateCaught(const StateRows& rows, const std::atomic<bool>& ending);

/// The parts that measure; either may be missing.
struct MeasuringParts {
  FibreCarrierWorker* carriers = nullptr;
  CameraWorker* camera = nullptr;
};
/// As MeasureUnits; exposures are counted in `counters`.
ExposureDone MeasureCaught(const CameraWork& work, const MeasuringParts& parts,
                           const std::atomic<bool>& ending, WorkCounters* counters);

}  // namespace focalfleet
