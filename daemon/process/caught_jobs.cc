#include "daemon/process/caught_jobs.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <string>

#include "daemon/clock/wall_time.h"
#include "daemon/hall/measure.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

/// Limit of the time of one plan. The densest plate of 5000 units takes minutes. With half of the
/// limit a busy host might not finish such a plan. Twice as much would hold an operator up for
/// longer after a search that finds no end.
constexpr std::chrono::minutes kPlanWithin{15};

template <class Job, class Failed>
auto Caught(const Job& job, const Failed& failed) {
  try {
    return job();
  } catch (const std::exception& error) {
    spdlog::error("a job failed: {}", error.what());
    return failed(error.what());
  }
}

void Count(const ExposureDone& done, WorkCounters* work) {
  if (done.exposure && !done.exposure->camera && done.exposure->camera_trouble.empty())
    return;  // the units' own sensors were enough
  ++work->exposures;
  if (done.exposure && done.exposure->camera_trouble.empty())
    work->exposed_at_s = 1e-9 * static_cast<double>(WallTime::Now().ns);
  else
    ++work->exposures_failed;
}

}  // namespace

PlanDone PlanCaught(const PlannerWork& work, const Layout& layout, const std::atomic<bool>& ending,
                    const std::function<void()>& alive) {
  const auto begun = std::chrono::steady_clock::now();
  const auto abandoned = [&ending, &work, &alive, begun] {
    alive();  // a plan shows that it proceeds by asking whether it is still wanted
    return ending.load() || (work.given_up != nullptr && work.given_up->load()) ||
           std::chrono::steady_clock::now() - begun > kPlanWithin;
  };
  return Caught(
      [&] { return RunPlanJob(work.job, layout, work.drives, abandoned); },
      [&](const std::string& why) {
        return PlanFailed(work.job, {ErrorCode::kUnavailable, "the planner failed: " + why});
      });
}

ExposureDone MeasureCaught(const CameraWork& work, const MeasuringParts& parts,
                           const std::atomic<bool>& ending, WorkCounters* counters) {
  ExposureDone done = Caught(
      [&] { return MeasureUnits(work, parts.carriers, parts.camera, ending); },
      [&](const std::string& why) -> ExposureDone {
        return {work.job.id, Fail(ErrorCode::kUnavailable, "the measurement failed: " + why)};
      });
  Count(done, counters);
  return done;
}

}  // namespace focalfleet
