// The configuration under way: its goal unit by unit, its phase, its published view, and the
// outcomes of its targets. Decisions about motion are not made here: the executor takes it from
// phase to phase.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/configuration_phase.h"
#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/goal.h"
#include "fleet/coordinate/target_outcomes.h"

namespace focalfleet {

/// A unit of the goal.
struct ConfigurationUnit {
  /// The target of the goal, as near as the unit gets, theta in the whole turn that is taken.
  std::optional<Pose> goal;
  /// Where the unit is to end: the goal, or short of it where a correction follows.
  std::optional<Pose> target;
  std::string target_id;       // empty: no name
  bool excluded = false;       // failed in this goal: stands still from then on
  std::uint8_t strikes = 0;    // refusals and missed starts
  std::optional<Pose> stood;   // its place before it was sent off
  HostInstant ended = kNever;  // the end of its last motion, when it was heard; kNever: not known
};

class Configuration {
 public:
  /// The view is that of the last stored configuration, if there is one.
  explicit Configuration(const Coordination& fleet);
  Configuration(const Configuration&) = delete;
  Configuration& operator=(const Configuration&) = delete;

  /// Takes the goal; every target is as the command has it, and no outcome is set yet.
  void Begin(std::uint64_t request, const Goal& goal);

  [[nodiscard]] ConfigurationUnit& operator[](PositionerIndex i) { return units_[i.value]; }
  [[nodiscard]] const ConfigurationUnit& operator[](PositionerIndex i) const {
    return units_[i.value];
  }
  [[nodiscard]] ConfigurationPhase phase() const { return phase_; }
  [[nodiscard]] bool busy() const { return phase_ != ConfigurationPhase::kIdle; }
  /// Pre: IsAllowed.
  void SetPhase(ConfigurationPhase phase);
  /// All motion is over: the configuration ends as `state` when its last rows are durable.
  void EndWhenDurable(ConfigurationState state);

  /// A refusal or a missed start of the unit. The second one in a goal is no accident: the target
  /// has failed, and the unit is excluded.
  void Strike(PositionerIndex i, const std::string& reason);
  void ForgetStrikes();
  /// The unit has another target, and every chance again.
  void Retarget(PositionerIndex i, const Pose& target);
  /// The unit is sent again: how far it was off says nothing of where it goes now.
  void SendAgain(PositionerIndex i);

  /// Brings the counts of frames and bits in the view up to date.
  void CountTraffic();
  /// Notes the row of this configuration.
  void Record();
  /// Replies to the command that began it, if it still waits.
  void ReplyLast(std::optional<Error> error, std::string text);

  ConfigurationView view;
  TargetOutcomes outcomes;
  std::optional<ApplyCommand::Measure> measure;
  bool fixed = false;
  bool stopping = false;
  ConfigurationState end = ConfigurationState::kDone;  // in kReporting
  std::string failure;                                 // why targets fail, for people
  HostInstant due = kNever;  // when the executor has something to do without an event

 private:
  const Coordination fleet_;
  std::vector<ConfigurationUnit> units_;
  ConfigurationPhase phase_ = ConfigurationPhase::kIdle;
  std::uint64_t request_ = 0;  // 0: answered
  std::uint64_t frames_before_ = 0;
};

/// Ends the configurations that an earlier run left open.
void EndEarlierConfigurations(const Coordination& fleet);
/// The text for a configuration that the end of the daemon cuts short.
[[nodiscard]] std::string DaemonEnded(std::uint64_t configuration);

}  // namespace focalfleet
