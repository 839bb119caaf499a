#include "fleet/coordinate/measured_outcomes.h"

#include <cstdio>
#include <string>

namespace focalfleet {
namespace {

std::string Micrometres(double um) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f um", um);
  return text;
}

std::string WhyNotMeasured(const Coordination& fleet, const ConfigurationView& configuration,
                           PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  if (!configuration.not_measured.empty()) return "not measured: " + configuration.not_measured;
  if (view.phase != UnitPhase::kReady) return "not measured: it " + fleet.units.TroubleOf(i);
  if (!view.measurement) return "not measured: not looked for";
  if (IsPut(*view.measurement))
    return IsPlace(view.knowledge)
               ? "not measured: it was seen, and has moved since"
               : "not measured: its fibre was seen, but more than one pose of its arms is possible";
  std::string why = std::string("not measured: ") + Name(*view.measurement);
  if (view.measurement == MeasurementStatus::kSensorsDoubted && view.carrier)
    why += " (" + view.carrier->verdict + ")";
  return why;
}

/// Why a unit ends too far from its target, to follow the distance; empty: not known.
std::string WhyItStays(const Coordination& fleet, const Corrections& corrections,
                       PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  if (!IsPlace(view.knowledge)) return {};
  if (fleet.units.NearestInReach(i, *view.target) != *view.target)
    return ": its range ends before it";
  if (corrections.HasNoRoom(i)) return ": its neighbours leave no room to correct it";
  return {};
}

}  // namespace

void JudgeMeasured(const Coordination& fleet, const Corrections& corrections,
                   Configuration* configuration) {
  if (!configuration->measure || configuration->view.kind != ConfigurationKind::kApply) return;
  const ApplyCommand::Measure& measure = *configuration->measure;
  const bool looked =
      !configuration->view.measured.empty() && configuration->view.not_measured.empty();
  TargetOutcomes& outcomes = configuration->outcomes;
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n) {
    const UnitView& view = fleet.units[{n}].view;
    if (view.outcome != TargetOutcome::kArrived || !view.target) continue;
    const bool is_within = view.error_um && *view.error_um <= measure.tolerance_um;
    if (measure.observe ? looked : is_within) continue;
    outcomes.Reopen({n});
    if (!measure.observe && view.error_um)
      outcomes.Set({n}, TargetOutcome::kFailed,
                   Micrometres(*view.error_um) + " from its target as measured, more than " +
                       Micrometres(measure.tolerance_um) + WhyItStays(fleet, corrections, {n}));
    else if (configuration->end == ConfigurationState::kStopped)
      outcomes.Set({n}, TargetOutcome::kStopped,
                   configuration->failure + ", before it was measured");
    else
      outcomes.Set({n}, TargetOutcome::kUnmeasured,
                   WhyNotMeasured(fleet, configuration->view, {n}));
  }
}

void JudgeFound(const Coordination& fleet, Configuration* configuration) {
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n) {
    const UnitView& view = fleet.units[{n}].view;
    if (view.outcome != TargetOutcome::kPending) continue;
    const bool found = view.knowledge[0].witness == Witness::kMeasured &&
                       view.knowledge[1].witness == Witness::kMeasured && view.measurement &&
                       IsPut(*view.measurement);
    configuration->outcomes.Set({n}, found ? TargetOutcome::kArrived : TargetOutcome::kUnmeasured,
                                found ? "" : WhyNotMeasured(fleet, configuration->view, {n}));
  }
}

}  // namespace focalfleet
