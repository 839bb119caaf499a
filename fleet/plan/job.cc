#include "fleet/plan/job.h"

#include <algorithm>

namespace focalfleet {
namespace {

bool AnyTarget(const std::vector<std::optional<Pose>>& targets) {
  return std::any_of(targets.begin(), targets.end(), [](const auto& t) { return t.has_value(); });
}

bool NeighbourOfAny(const Layout& layout, PositionerIndex unit,
                    const std::vector<PositionerIndex>& chosen) {
  const auto neighbours = layout.neighbours(unit);
  return std::any_of(chosen.begin(), chosen.end(), [&](PositionerIndex other) {
    return std::binary_search(neighbours.begin(), neighbours.end(), other);
  });
}

PlanDone PlanHomingWave(const PlanJob& job, PlanRequest request) {
  PlanDone done{job.job, Plan{}, {}};
  std::optional<PositionerIndex> crowded;  // the first that needs others to step aside
  std::vector<std::optional<Pose>> way;
  Error refusal;
  for (const PositionerIndex unit : job.to_home) {
    if (NeighbourOfAny(*request.layout, unit, done.homing)) continue;
    auto targets = MakeWayForHoming(request, unit);
    if (!targets) {
      refusal = targets.error();
    } else if (!AnyTarget(*targets)) {
      done.homing.push_back(unit);
    } else if (!crowded) {
      crowded = unit;
      way = std::move(*targets);
    }
  }
  if (!done.homing.empty()) return done;
  if (!crowded) {
    done.plan = tl::unexpected(refusal);
    return done;
  }
  request.targets = way;
  done.plan = MakePlan(request, job.options);
  done.homing = {*crowded};
  if (done.plan && !done.plan->unserved.empty())
    done.plan = Fail(ErrorCode::kRefused,
                     "unit " + std::to_string(request.layout->unit(*crowded).id.value) +
                         " cannot home: its neighbours find no way to step aside");
  return done;
}

}  // namespace

PlanDone RunPlanJob(const PlanJob& job, const Layout& layout, std::span<const UnitDrive> drives) {
  const PlanRequest request{.layout = &layout,
                            .drives = drives,
                            .start = job.start,
                            .targets = job.targets,
                            .frozen = job.frozen};
  if (!job.to_home.empty()) return PlanHomingWave(job, request);
  return {job.job, MakePlan(request, job.options), {}};
}

}  // namespace focalfleet
