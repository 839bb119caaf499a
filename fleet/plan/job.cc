#include "fleet/plan/job.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <utility>

#include "fleet/estimate.h"

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

// The moves that let one unit home, or the reason why there are none.
Result<Plan> PlanWayFor(PositionerIndex unit, const std::vector<std::optional<Pose>>& way,
                        PlanRequest request, const PlanOptions& options) {
  request.targets = way;
  FOCALFLEET_TRY_ASSIGN(Plan plan, MakePlan(request, options));
  if (plan.unserved.empty()) return plan;
  return Fail(ErrorCode::kRefused, "unit " + std::to_string(request.layout->unit(unit).id.value) +
                                       " cannot home: its neighbours find no way to step aside");
}

PlanDone PlanHomingWave(const PlanJob& job, const PlanRequest& request,
                        const PlanOptions& options) {
  PlanDone done{.job = job.job, .purpose = job.purpose, .plan = Plan{}};
  Error refusal;
  std::vector<std::pair<PositionerIndex, std::vector<std::optional<Pose>>>> crowded;
  for (const PositionerIndex unit : job.to_home) {
    if (NeighbourOfAny(*request.layout, unit, done.homing)) continue;
    auto targets = MakeWayForHoming(request, unit);
    if (!targets) {
      refusal = targets.error();
    } else if (!AnyTarget(*targets)) {
      done.homing.push_back(unit);
    } else if (done.homing.empty()) {
      crowded.emplace_back(unit, std::move(*targets));
    }
  }
  if (!done.homing.empty()) return done;
  for (const auto& [unit, way] : crowded) {
    if (IsAbandoned(options.abandoned)) break;
    done.plan = PlanWayFor(unit, way, request, options);
    if (done.plan) {
      done.homing = {unit};
      return done;
    }
    refusal = done.plan.error();
  }
  if (job.unproven) {
    done.plan = Plan{};
    done.homing = {job.to_home.front()};
  } else {
    done.plan = tl::unexpected(refusal);
  }
  return done;
}

PlanDone PlanLateMove(const PlanJob& job, const Layout& layout, std::span<const UnitDrive> drives) {
  PlanDone done{.job = job.job, .purpose = job.purpose, .plan = Plan{}};
  done.late = job.late->running->Replan(job.late->question, job.late->deviations);
  if (!*done.late) return done;
  Plan alone;
  alone.moves.push_back((*done.late)->move);
  const PlanEstimate estimate = Estimate(alone, layout, drives, MotorModel{});
  done.predicted = {(*done.late)->end_s, estimate.energy_J, estimate.peak_power_W};
  return done;
}

PlanDone PlanOf(const PlanJob& job, const PlanRequest& request, const Abandoned& abandoned) {
  PlanOptions options = job.options;
  options.abandoned = abandoned;
  if (!job.to_home.empty()) return PlanHomingWave(job, request, options);
  PlanDone done{.job = job.job, .purpose = job.purpose, .plan = MakePlan(request, options)};
  // The running plan is kept with options that cannot be abandoned: it outlives the caller.
  if (done.plan && job.purpose == PlanPurpose::kConfiguration)
    done.running = std::make_shared<const RunningPlan>(request, done.plan->moves, job.options);
  return done;
}

}  // namespace

PlanDone RunPlanJob(const PlanJob& job, const Layout& layout, std::span<const UnitDrive> drives,
                    const Abandoned& abandoned) {
  std::uint64_t looks = 0;
  std::uint64_t given_up_at_look = 0;
  const auto counted = [&] {
    ++looks;
    if (given_up_at_look == 0 && abandoned()) given_up_at_look = looks;
    return given_up_at_look != 0;
  };
  if (job.late) return PlanLateMove(job, layout, drives);
  const PlanRequest request{.layout = &layout,
                            .drives = drives,
                            .start = job.start,
                            .targets = job.targets,
                            .frozen = job.frozen,
                            .offsets = job.offsets};
  PlanDone done = PlanOf(job, request, abandoned ? Abandoned(std::cref(counted)) : Abandoned());
  done.given_up_at_look = given_up_at_look;
  if (done.plan) {
    const PlanEstimate estimate = Estimate(*done.plan, layout, drives, MotorModel{});
    done.predicted = {estimate.makespan_s, estimate.energy_J, estimate.peak_power_W};
  }
  return done;
}

PlanDone PlanFailed(const PlanJob& job, Error why) {
  PlanDone done{.job = job.job, .purpose = job.purpose, .plan = Plan{}};
  if (job.late)
    done.late = tl::unexpected(std::move(why));
  else
    done.plan = tl::unexpected(std::move(why));
  return done;
}

}  // namespace focalfleet
