#include "fleet/plane/plane_plan.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "fleet/estimate.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

/// A unit of the plan, as its sector and the plane know it.
struct Place {
  PositionerIndex plane;
  PositionerIndex local;
  std::uint32_t sector = 0;
};

class Divider {
 public:
  Divider(const PlaneJob& job, const PlaneLayout& plane) : job_(job), plane_(plane) {
    out_.rounds.resize(plane.sectors());
    for (std::uint32_t sector = 0; sector < plane.sectors(); ++sector) {
      out_.rounds[sector].job = job.sector_jobs[sector];
      out_.rounds[sector].start_skew_s = job.plan.options.start_skew_s;
    }
  }

  PlanePlan Divide(const Plan& plan, const std::vector<PositionerIndex>& homing) {
    // Units that make way come first; the next plan has the wave.
    if (plan.moves.empty())
      for (const PositionerIndex part : homing) {
        const Place at = PlaceOf(part);
        out_.rounds[at.sector].homing.push_back(at.local);
        ++out_.homing;
      }
    out_.makespan_s = plan.makespan_s;
    out_.moves = static_cast<std::uint32_t>(plan.moves.size());
    for (const UnitPlan& move : plan.moves) Add(move);
    for (const Unserved& unserved : plan.unserved) {
      std::string reason = Name(unserved.why);
      if (unserved.by) reason += " by unit " + std::to_string(IdOf(*unserved.by).value);
      const Place at = PlaceOf(unserved.unit);
      out_.rounds[at.sector].refused.push_back({at.local, std::move(reason)});
    }
    for (const Unnoticed& pair : plan.unnoticed)
      if (PlaceOf(pair.ends).sector != PlaceOf(pair.follower).sector)
        out_.unnoticed.push_back({IdOf(pair.ends), IdOf(pair.follower), pair.at_s});
    return std::move(out_);
  }

 private:
  [[nodiscard]] Place PlaceOf(PositionerIndex part) const {
    const PositionerIndex i = job_.units[part.value];
    return {i, plane_.Local(i), plane_.SectorOf(i)};
  }
  [[nodiscard]] UnitId IdOf(PositionerIndex part) const {
    return plane_.layout().unit(job_.units[part.value]).id;
  }

  void Add(const UnitPlan& move) {
    const Place at = PlaceOf(move.unit);
    UnitPlan own = move;
    own.unit = at.local;
    own.followers.clear();
    std::optional<SectorRound::LeadsBeyond> leads;
    for (const UnitPlan::Follower& follower : move.followers) {
      const Place follows = PlaceOf(follower.unit);
      UnitPlan::Follower local = follower;
      local.unit = follows.local;
      if (follows.sector == at.sector) {
        own.followers.push_back(local);
        continue;
      }
      ++out_.follows_beyond;
      out_.rounds[follows.sector].follows.push_back({IdOf(move.unit), at.sector, local});
      if (!leads) leads = {at.local, follower.since_s, follower.left_s};
      leads->since_s = std::min(leads->since_s, follower.since_s);
      leads->left_s = std::max(leads->left_s, follower.left_s);
    }
    SectorRound& round = out_.rounds[at.sector];
    if (leads) round.leads.push_back(*leads);
    round.moves.push_back(std::move(own));
  }

  const PlaneJob& job_;
  const PlaneLayout& plane_;
  PlanePlan out_;
};

}  // namespace

PlaneJob MakePlaneJob(std::uint64_t job, const PlaneLayout& plane,
                      std::span<const std::shared_ptr<const SectorJob>> jobs, double notice_s,
                      double clock_bound_s) {
  PlaneJob made;
  made.job = job;
  made.plan.job = job;
  PlanOptions& options = made.plan.options;
  options.lead_apart = true;
  options.notice_s = 0;
  for (const auto& sector : jobs) {
    made.sector_jobs.push_back(sector == nullptr ? 0 : sector->job);
    if (sector == nullptr) continue;
    options.fixed |= sector->fixed;
    options.leave_stuck |= sector->leave_stuck;
    made.plan.unproven |= sector->unproven;
    options.start_skew_s = std::max(options.start_skew_s, sector->start_skew_s);
    options.notice_s = std::max(options.notice_s, sector->notice_s);
  }
  options.start_skew_s += clock_bound_s;
  options.notice_s += notice_s;
  for (std::uint32_t n = 0; n < plane.layout().size(); ++n) {
    const SectorJob* const sector = jobs[plane.SectorOf({n})].get();
    if (sector == nullptr) continue;
    const std::uint32_t local = plane.Local({n}).value;
    const auto beyond = plane.beyond({n});
    const bool strip =
        std::ranges::any_of(beyond, [&](std::uint32_t other) { return jobs[other] == nullptr; });
    if (!strip && std::ranges::binary_search(sector->to_home, plane.Local({n})))
      made.plan.to_home.push_back({static_cast<std::uint32_t>(made.units.size())});
    made.units.push_back({n});
    made.strip.push_back(strip ? 1 : 0);
    made.drives.push_back(sector->drives[local]);
    made.plan.start.push_back(sector->start[local]);
    made.plan.targets.push_back(strip ? std::nullopt : sector->targets[local]);
    made.plan.frozen.push_back(strip || sector->frozen[local] != 0 ? 1 : 0);
    made.plan.offsets.push_back(sector->offsets[local]);
  }
  return made;
}

bool HasWork(const PlaneJob& job) {
  if (!job.plan.to_home.empty()) return true;
  for (std::size_t n = 0; n < job.units.size(); ++n) {
    const UnitKnowledge& start = job.plan.start[n];
    const std::optional<Pose>& target = job.plan.targets[n];
    if (target && !(IsPlace(start) && PlaceOf(start) == *target)) return true;
  }
  return false;
}

PlanePlanDone RunPlaneJob(const PlaneJob& job, const PlaneLayout& plane,
                          const Abandoned& abandoned) {
  PlanePlanDone done{job.job, PlanePlan{}};
  const Result<Layout> part = plane.layout().Part(job.units);
  if (!part) {
    done.plan = tl::unexpected(part.error());
    return done;
  }
  const PlanDone planned = RunPlanJob(job.plan, *part, job.drives, abandoned);
  if (!planned.plan) {
    done.plan = tl::unexpected(planned.plan.error());
    return done;
  }
  PlanePlan divided = Divider(job, plane).Divide(*planned.plan, planned.homing);
  for (std::uint32_t sector = 0; sector < plane.sectors(); ++sector) {
    SectorRound& round = divided.rounds[sector];
    std::ranges::sort(round.homing);
    if (round.moves.empty()) continue;
    // The estimate wants the moves under the plane's numbers, of which it has the layout.
    Plan own;
    for (const UnitPlan& move : planned.plan->moves)
      if (plane.SectorOf(job.units[move.unit.value]) == sector) own.moves.push_back(move);
    const PlanEstimate estimate = Estimate(own, *part, job.drives, MotorModel{});
    round.makespan_s = estimate.makespan_s;
    round.energy_J = estimate.energy_J;
    round.peak_power_W = estimate.peak_power_W;
  }
  done.plan = std::move(divided);
  return done;
}

}  // namespace focalfleet
