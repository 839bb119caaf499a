#include "fleet/coordinate/round_job.h"

#include "fleet/coordinate/stall_detection.h"

namespace focalfleet {
namespace {

/// The target of the unit in this round. None: it has none, or its outcome is settled here.
std::optional<Pose> TargetOf(PositionerIndex i, bool usable, ExecutorRooms* rooms) {
  const UnitTable& units = rooms->fleet.units;
  const UnitView& view = units[i].view;
  TargetOutcomes& outcomes = rooms->configuration.outcomes;
  if (view.outcome != TargetOutcome::kPending || !rooms->homing.to_home().empty()) return {};
  if (!usable) {
    outcomes.Set(i, TargetOutcome::kFailed,
                 view.phase == UnitPhase::kReady ? "fell out before" : "it " + units.TroubleOf(i));
    return {};
  }
  if (!IsPlace(view.knowledge)) {
    outcomes.Set(i, TargetOutcome::kRefused, "its place " + units.WhyNoPlace(i));
    return {};
  }
  return rooms->configuration[i].target;
}

}  // namespace

std::optional<PlanJob> JobOfRound(bool sets_out, ExecutorRooms* rooms) {
  const Coordination& fleet = rooms->fleet;
  Configuration& configuration = rooms->configuration;
  Corrections& corrections = rooms->corrections;
  Round& round = rooms->round;
  // A sector's units may be read still when a task begins, as after a kill in motion.
  if (fleet.config.in_plane) rooms->homing.RefuseUnready();
  PlanJob job{.job = ++round.job,
              .start = {},
              .targets = {},
              .frozen = {},
              .offsets = {},
              .options = {},
              .to_home = rooms->homing.to_home()};
  job.options.fixed = configuration.fixed;
  job.options.lead_apart = true;
  job.options.leave_stuck = !configuration.view.measured.empty();
  job.options.start_skew_s = round.skew_s = round.next_skew_s;
  job.options.notice_s = StallDetectionOf(fleet.config).notice.seconds();
  job.unproven = rooms->homing.unproven();
  bool any = !job.to_home.empty();
  if (!corrections.goes_past()) corrections.SetNext();
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n) {
    const UnitView& view = fleet.units[{n}].view;
    ConfigurationUnit& unit = configuration[{n}];
    const bool usable = view.phase == UnitPhase::kReady && view.enabled && !unit.excluded;
    if (sets_out) {
      unit.stood.reset();
      if (IsPlace(view.knowledge)) unit.stood = PlaceOf(view.knowledge);
    }
    job.start.push_back(view.knowledge);
    job.offsets.push_back(view.offset);
    job.frozen.push_back(usable ? 0 : 1);
    job.targets.push_back(TargetOf({n}, usable, rooms));
    any |= job.targets.back().has_value();
  }
  if (corrections.goes_past() && !corrections.GoPast(&job.targets)) {
    corrections.GiveUpApproach();
    corrections.SetNext();
    for (std::uint32_t n = 0; n < fleet.units.size(); ++n)
      if (job.targets[n]) job.targets[n] = configuration[{n}].target;
  }
  if (!any && !fleet.config.in_plane) return std::nullopt;
  return job;
}

}  // namespace focalfleet
