#include "fleet/coordinate/configuration.h"

#include <limits>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr std::uint8_t kStrikesMax = 1;

std::uint64_t FramesOf(const UnitTable& units) {
  std::uint64_t frames = 0;
  for (const BusRecord& bus : units.buses)
    frames += bus.view.frames_sent + bus.view.frames_received;
  return frames;
}

std::uint64_t UploadBitsOf(const UnitTable& units) {
  std::uint64_t bits = 0;
  for (const BusRecord& bus : units.buses) bits += bus.view.upload.bits;
  return bits;
}

}  // namespace

std::string DaemonEnded(std::uint64_t configuration) {
  return "configuration " + std::to_string(configuration) +
         " has failed: the daemon ended; what moves finishes by itself";
}

void EndEarlierConfigurations(const Coordination& fleet) {
  for (ConfigurationRow& row : fleet.ledger.earlier_configurations) {
    if (IsOver(row.state)) continue;
    row.state = ConfigurationState::kFailed;
    fleet.ledger.alarms().Raise(AlarmName::kConfigurationCutShort, {}, {}, DaemonEnded(row.id));
    fleet.ledger.Note(row);
  }
  fleet.ledger.earlier_configurations.clear();
}

Configuration::Configuration(const Coordination& fleet)
    : outcomes(fleet, &view), fleet_(fleet), units_(fleet.units.size()) {
  if (fleet.ledger.earlier_configurations.empty()) return;
  const ConfigurationRow& last = fleet.ledger.earlier_configurations.back();
  view = {.id = last.id,
          .source = last.source,
          .state = IsOver(last.state) ? last.state : ConfigurationState::kFailed,
          .counts = last.counts,
          .makespan_predicted_s = last.makespan_predicted_s,
          .makespan_s = last.makespan_s,
          .energy_J = last.energy_J,
          .peak_power_W = last.peak_power_W,
          .began = {},
          .started = kNever};
}

void Configuration::Begin(std::uint64_t request, const Goal& goal) {
  request_ = request;
  fixed = goal.fixed;
  measure = goal.measure;
  failure.clear();
  stopping = false;
  view = {.id = fleet_.ledger.TakeConfigurationId(),
          .kind = goal.kind,
          .source = goal.source,
          .state = ConfigurationState::kPlanning,
          .began = fleet_.now(),
          .started = kNever};
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    ConfigurationUnit& unit = units_[n];
    unit.target = goal.targets[n];
    if (goal.kind == ConfigurationKind::kApply)  // else those of the configuration before stay
      unit.target_id = goal.target_ids.empty() ? std::string() : goal.target_ids[n];
    unit.excluded = false;
    unit.strikes = 0;
    UnitView& published = fleet_.units[{n}].view;
    published.target = goal.targets[n];
    published.outcome = TargetOutcome::kNone;
    published.outcome_reason.clear();
    published.measurement.reset();
    published.error_um.reset();
    fleet_.units.Changed({n});
  }
  frames_before_ = FramesOf(fleet_.units);
  for (BusRecord& bus : fleet_.units.buses) {
    bus.view.load_max = 0;
    bus.view.upload = {};
  }
}

void Configuration::SetPhase(ConfigurationPhase phase) {
  FOCALFLEET_CHECK(IsAllowed(phase_, phase));
  phase_ = phase;
}

void Configuration::EndWhenDurable(ConfigurationState state) {
  end = state;
  due = fleet_.now();
  SetPhase(ConfigurationPhase::kReporting);
}

void Configuration::Strike(PositionerIndex i, const std::string& reason) {
  ConfigurationUnit& unit = units_[i.value];
  if (unit.strikes++ < kStrikesMax) return;
  outcomes.Set(i, TargetOutcome::kFailed, reason);
  unit.excluded = true;
}

void Configuration::ForgetStrikes() {
  for (ConfigurationUnit& unit : units_) unit.strikes = 0;
}

void Configuration::Retarget(PositionerIndex i, const Pose& target) {
  ConfigurationUnit& unit = units_[i.value];
  if (!unit.target) ++view.counts.targeted;
  unit.target = unit.goal = fleet_.units[i].view.target = target;
  unit.target_id.clear();  // the name was the other target's
  unit.excluded = false;
  unit.strikes = 0;
  outcomes.Restart(i);
}

void Configuration::SendAgain(PositionerIndex i) {
  outcomes.Reopen(i);
  fleet_.units[i].view.error_um.reset();
}

void Configuration::CountTraffic() {
  view.frames = FramesOf(fleet_.units) - frames_before_;
  view.upload.bits = UploadBitsOf(fleet_.units);
}

void Configuration::ReplyLast(std::optional<Error> error, std::string text) {
  if (request_ == 0) return;
  fleet_.out().replies.push_back({request_, true, std::move(error), std::move(text)});
  request_ = 0;
}

void Configuration::Record() {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  const bool known = view.starts.reported > 0;
  fleet_.ledger.Note(
      ConfigurationRow{.id = view.id,
                       .source = view.source,
                       .state = view.state,
                       .counts = view.counts,
                       .makespan_predicted_s = view.makespan_predicted_s,
                       .makespan_s = view.makespan_s,
                       .energy_J = view.energy_J,
                       .peak_power_W = view.peak_power_W,
                       .start_skew_s = known ? view.starts.skew_s : kNotKnown,
                       .start_skew_bound_s = known ? view.starts.bound_s : kNotKnown});
}

}  // namespace focalfleet
