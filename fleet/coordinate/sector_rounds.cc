#include "fleet/coordinate/sector_rounds.h"

#include <algorithm>
#include <string>

#include "fleet/coordinate/watch.h"
#include "protocol/base/limits.h"

namespace focalfleet {

Status SectorRounds::Do(const SectorRound& round) {
  if (const std::string fault = FaultOf(round, rooms_.fleet.units.size()); !fault.empty())
    return Fail(ErrorCode::kInvalid, "the round is refused: " + fault);
  if (rooms_.configuration.phase() != ConfigurationPhase::kPlanning ||
      round.job != rooms_.round.job)
    return Fail(ErrorCode::kRefused, "nobody waits for this round");
  progress_.TakeRound(round);
  return {};
}

Status SectorRounds::Do(const SectorStartCommand& start) {
  if (View().stage != SectorStage::kReady || start.job != rooms_.round.job)
    return Fail(ErrorCode::kRefused, "this round is not held");
  // The start signal is said three times, and has to reach the units before the instant.
  if (start.at < rooms_.fleet.now() + DurationNs{rooms_.fleet.config.start_delay.ns / 2})
    return Fail(ErrorCode::kRefused, "the start comes too late");
  rooms_.round.border.start_at = start.at;
  return {};
}

Status SectorRounds::Do(const SectorWithdrawCommand& withdraw) {
  if (withdraw.job == rooms_.round.job) progress_.Withdraw();
  return {};
}

Status SectorRounds::Do(const BorderEndCommand& end) {
  if (rooms_.configuration.phase() == ConfigurationPhase::kMoving)
    StopFollowersBeyond(rooms_.fleet, rooms_.round, end);
  return {};
}

Status SectorRounds::Do(const SectorRetargetCommand& command) {
  Configuration& configuration = rooms_.configuration;
  const std::size_t units = rooms_.fleet.units.size();
  for (const SectorRetargetCommand::Target& target : command.targets)
    if (target.unit.value >= units)
      return Fail(ErrorCode::kInvalid, "another target for a unit that is none of this sector");
  if (!configuration.busy() || configuration.view.kind != ConfigurationKind::kApply ||
      configuration.stopping || configuration.phase() == ConfigurationPhase::kReporting)
    return Fail(ErrorCode::kRefused, "no configuration with targets is under way");
  for (const auto& [i, pose] : command.targets) {
    const UnitView& view = rooms_.fleet.units[i].view;
    const std::string name = rooms_.fleet.units.NameOf(i);
    configuration.Retarget(i, pose);
    rooms_.corrections.Forget(i);
    rooms_.fleet.ledger.alarms().Raise(AlarmName::kUnitRetargeted, i, {},
                                       name + " gets another target");
    if (!view.enabled)
      configuration.outcomes.Set(i, TargetOutcome::kRefused, "disabled: " + view.disabled_reason);
    else if (rooms_.fleet.units.NearestInReach(i, pose) != pose)
      configuration.outcomes.Set(i, TargetOutcome::kRefused,
                                 "its range, as it was measured, ends before it");
  }
  progress_.Withdraw();
  return {};
}

Status SectorRounds::Do(const SectorFindings& findings) {
  const std::size_t units = rooms_.fleet.units.size();
  const auto is_none = [units](const Measurement& measurement) {
    return measurement.unit.value >= units ||
           (measurement.other && measurement.other->value >= units) ||
           (measurement.place && std::ranges::any_of(*measurement.place, [](std::int64_t vectors) {
              return vectors < -limits::kPositionMax || vectors > limits::kPositionMax;
            }));
  };
  if (findings.findings && std::ranges::any_of(findings.findings->measurements, is_none))
    return Fail(ErrorCode::kInvalid, "findings about units or places that are none of this sector");
  progress_.OnExposure({findings.exposure, findings.findings});
  return {};
}

SectorView SectorRounds::View() const {
  const auto stage = [this] {
    switch (rooms_.configuration.phase()) {
      case ConfigurationPhase::kIdle:
        return SectorStage::kIdle;
      case ConfigurationPhase::kPlanning:
        return SectorStage::kAsking;
      case ConfigurationPhase::kCommitting:
      case ConfigurationPhase::kHomeCommitting:
        return IsHeld(rooms_) ? SectorStage::kReady : SectorStage::kPreparing;
      case ConfigurationPhase::kMoving:
      case ConfigurationPhase::kHoming:
        return SectorStage::kMoving;
      case ConfigurationPhase::kMeasuring:
        return rooms_.measurement.IsAsked() ? SectorStage::kLooking : SectorStage::kPreparing;
      case ConfigurationPhase::kReporting:
        return SectorStage::kEnding;
      default:
        return SectorStage::kPreparing;
    }
  };
  return {stage(), rooms_.round.job, rooms_.measurement.look() == Look::kBefore};
}

}  // namespace focalfleet
