#include "daemon/process/caught_jobs.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <string>
#include <utility>

#include "daemon/clock/wall_time.h"
#include "daemon/hall/measure.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

bool IsGivenUp(const PlannerWork& work) {
  return work.given_up != nullptr && work.given_up->load();
}

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
                    const std::function<void()>& alive, std::chrono::nanoseconds within) {
  const auto begun = std::chrono::steady_clock::now();
  bool is_late = false;
  const auto abandoned = [&] {
    alive();  // a plan shows that it proceeds by asking whether it is still wanted
    if (ending.load() || IsGivenUp(work)) return true;
    is_late = std::chrono::steady_clock::now() - begun > within;
    return is_late;
  };
  const auto failed = [&work](ErrorCode code, std::string why) {
    return PlanFailed(work.job, {code, std::move(why)});
  };
  PlanDone done = Caught([&] { return RunPlanJob(work.job, layout, work.drives, abandoned); },
                         [&](const std::string& why) {
                           return failed(ErrorCode::kUnavailable, "the planner failed: " + why);
                         });
  if (done.plan) return done;
  if (IsGivenUp(work))
    return failed(ErrorCode::kRefused, "a configuration was commanded and is planned first");
  if (is_late)
    return failed(ErrorCode::kUnavailable,
                  fmt::format("the planner found no plan within {} minutes",
                              std::chrono::duration_cast<std::chrono::minutes>(within).count()));
  return done;
}

std::string StateCaught(const StateRows& rows, const std::atomic<bool>& /*ending*/) {
  return Caught([&] { return StateText(*rows); }, [](const char*) { return std::string(); });
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
