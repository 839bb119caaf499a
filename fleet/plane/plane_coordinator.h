// The plane's coordinator takes a configuration over all sectors: one plan, one start instant.
//
//   listening -> claiming -> idle -> recording -> gathering -> planning -> preparing -> moving
//                                                     ^           |            |          |
//                                                     +-----------+------------+----------+
//                                                     |
//                                                     +-> finishing -> idle      (stop: stopping)
//                                                     |        |
//                                                     +--- measuring
//
// gathering   every sector is given the configuration, and asks for a plan
// planning    one plan of all units of the sectors that ask (plane_plan.h)
// preparing   each sector uploads its part, reads back, arms, and makes its intents durable
// moving      all sectors that hold the round have the start instant; each moves or gives it back
// finishing   nothing is left to move: each sector ends the configuration, or asks for an exposure
// measuring   the plane's camera looks at all units at once; each sector is told of its own, and
//             asks for the next round of corrections, or ends the configuration
//
// The state is what the sectors report. The coordinator keeps its epoch, the configuration under
// way and the last one that is over, and nothing else, so that a new life of it goes on in any
// phase: it takes a new epoch, gives back what is held, waits until what moves has ended, and goes
// on with a new plan. A sector that begins another life is told of the last configuration, so that
// it knows what became of its units.
//
// Two coordinators. Each sector follows the highest epoch that it has heard. A coordinator that
// hears of a higher one than its own says nothing more, and takes over again where no sector has
// had an order for PlaneTimes::takeover. While sectors follow different coordinators, units at the
// borders between them stand (plane_plan.h), so that nothing can touch.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_plan.h"
#include "fleet/plane/sector_book.h"
#include "fleet/plane/sector_clock_watch.h"

namespace focalfleet {

struct PlaneConfiguration {
  std::uint64_t id = 0;
  std::string source;
  bool fixed = false;
  std::vector<std::optional<Pose>> targets;  // Shape: (units of the plane)
  std::vector<std::string> target_ids;       // Shape: the same, or empty
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::vector<PositionerIndex> to_home = {};  // ascending
  bool unproven = false;                      // HomeCommand::unproven
  std::optional<ApplyCommand::Measure> measure = {};
  /// The last change of each unit whose target was changed since the configuration began, by its
  /// number.
  std::map<std::uint64_t, PositionerIndex> changes = {};
  bool operator==(const PlaneConfiguration&) const = default;
};

/// All that a coordinator keeps.
struct PlaneRecord {
  PlaneEpoch epoch;
  std::uint64_t next_configuration = 1;
  std::optional<PlaneConfiguration> under_way;
  /// The last one that is over, and how it ended: sectors that begin another life are told of it.
  std::optional<PlaneConfiguration> last = {};
  ConfigurationState last_state = ConfigurationState::kDone;
};

struct PlaneApplyCommand {
  std::string source;
  bool fixed = false;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::string> target_ids;
  std::optional<ApplyCommand::Measure> measure = {};
};
struct PlaneStopCommand {};
/// Measures all units once; no unit moves.
struct PlaneMeasureCommand {};
struct PlaneHomeCommand {
  std::vector<PositionerIndex> units;
  bool unproven = false;  // HomeCommand::unproven
};
/// A unit of the configuration under way has another target, and goes there in the next round.
struct PlaneRetargetCommand {
  PositionerIndex unit;
  Pose target{};
};
struct PlaneCommand {
  std::uint64_t request = 0;
  std::variant<PlaneApplyCommand, PlaneStopCommand, PlaneHomeCommand, PlaneRetargetCommand,
               PlaneMeasureCommand>
      what;
};

enum class PlanePhase : std::uint8_t {
  kListening,
  kClaiming,
  kIdle,
  kRecording,
  kGathering,
  kPlanning,
  kPreparing,
  kMoving,
  kFinishing,
  kStopping,
  kMeasuring,
};
inline constexpr std::size_t kPlanePhaseCount = 11;
constexpr const char* Name(PlanePhase phase) {
  constexpr const char* kNames[] = {"listening", "claiming", "idle",      "recording",
                                    "gathering", "planning", "preparing", "moving",
                                    "finishing", "stopping", "measuring"};
  return kNames[static_cast<std::size_t>(phase)];
}

struct PlaneInputs {
  HostInstant now;
  std::span<const SectorReport> reports = {};
  std::span<const PlaneCommand> commands = {};
  std::span<const PlanePlanDone> plans = {};
  std::span<const ExposureDone> exposures = {};  // units by the plane's positions
  std::uint64_t kept = 0;                        // the number of the last record that is durable
};

/// Lists of the job and `drives` are by the plane's positions.
struct PlaneExposure {
  ExposureJob job;
  std::vector<UnitDrive> drives;
};

struct PlaneEffects {
  std::vector<PlaneOrder> orders;
  std::optional<PlaneJob> job;
  /// Asks the plane's camera for an exposure, and for the place of each unit in it.
  std::optional<PlaneExposure> exposure;
  std::optional<PlaneRecord> record;  // is to be made durable, under `record_number`
  std::uint64_t record_number = 0;
  std::vector<ReplyEffect> replies;
  std::vector<std::string> log;  // for people
  std::vector<ShellNote> notes;  // alarms of the plane, and their ends
  HostInstant wake_at = kNever;
};

/// The configuration under way, or the last one.
struct PlaneView {
  PlanePhase phase = PlanePhase::kListening;
  PlaneEpoch epoch;
  std::uint64_t configuration = 0;
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::string source;
  ConfigurationState state = ConfigurationState::kDone;
  std::uint32_t rounds = 0;
  OutcomeCounts counts = {};        // of all sectors that were heard
  std::string waiting_for = {};     // for people; usually empty
  double makespan_predicted_s = 0;  // of all rounds
  /// The guarantee of the last plan over borders.
  std::uint32_t follows_beyond = 0;
  std::vector<UnnoticedPair> unnoticed = {};
  HostInstant start_at = kNever;             // of the last round
  std::vector<MeasuredRound> measured = {};  // blind, then after each correction
  std::string not_measured = {};             // why the last exposure could not be used
};

/// The part of a sector in a round.
struct PlanePart {
  std::uint64_t incarnation = 0;
  std::uint64_t job = 0;  // or the exposure that it asks for; 0: none
  bool operator==(const PlanePart&) const = default;
};

class PlaneCoordinator {
 public:
  /// `plane` outlives the coordinator. `self` is its own number, which no other coordinator has.
  PlaneCoordinator(const PlaneLayout* plane, const PlaneTimes& times, std::uint64_t self,
                   PlaneRecord kept);

  void Step(const PlaneInputs& inputs, PlaneEffects* effects);

  [[nodiscard]] const PlaneView& view() const { return view_; }
  [[nodiscard]] const SectorBook& sectors() const { return sectors_; }
  [[nodiscard]] bool busy() const { return record_.under_way.has_value(); }
  /// Null: none.
  [[nodiscard]] const PlaneConfiguration* under_way() const {
    return record_.under_way ? &*record_.under_way : nullptr;
  }

 private:
  void Enter(PlanePhase phase);
  void Keep();
  void Obey(const PlaneCommand& command);
  Status Do(std::uint64_t request, const PlaneApplyCommand& command);
  Status Do(std::uint64_t request, const PlaneStopCommand& command);
  Status Do(std::uint64_t request, const PlaneHomeCommand& command);
  Status Do(std::uint64_t request, const PlaneRetargetCommand& command);
  Status Do(std::uint64_t request, const PlaneMeasureCommand& command);
  [[nodiscard]] Status MayBegin() const;
  void Begin(std::uint64_t request, PlaneConfiguration configuration);
  void AnswerRetargets();
  [[nodiscard]] std::uint64_t LastChangeOf(std::uint32_t sector) const;
  [[nodiscard]] std::shared_ptr<const SectorTask> TaskOf(const PlaneConfiguration& configuration,
                                                         std::uint32_t sector) const;
  [[nodiscard]] PlaneOrder RetargetsOf(std::uint32_t sector) const;
  void Count();
  void Idle();
  void Recall(std::uint32_t sector);
  void Listen();
  void Claim();
  void Gather();
  enum class Readiness : std::uint8_t { kReady, kWaits, kMoves, kOver, kLooks, kAbsent };
  Readiness Prepare(std::uint32_t sector);
  Readiness PrepareOwn(std::uint32_t sector);
  void Plan(const std::vector<std::uint32_t>& ready, bool settling);
  [[nodiscard]] std::shared_ptr<const SectorJob> StandingJob(std::uint32_t sector) const;
  [[nodiscard]] bool Looks(std::uint32_t sector) const;
  void Look();
  void TakeExposure(const ExposureDone& done);
  void Summarise(const ExposureFindings& findings);
  void TakePlan(const PlanePlanDone& done);
  void GiveRound(PlanePlan plan);
  void Preparing();
  void Start();
  void Moving();
  [[nodiscard]] PlaneOrder EndOf(std::uint32_t sector, SectorRound body) const;
  void Finish(const std::string& failure, const PlanePlan* plan);
  void Finishing();
  void Stop(const std::string& why);
  void Stopping();
  void End(ConfigurationState state);
  void Reply(std::optional<Error> error, std::string text);
  /// The configuration under way, or the last one.
  [[nodiscard]] PlaneConfigurationId Id() const { return {self_, view_.configuration}; }

  const PlaneLayout& plane_;
  const PlaneTimes times_;
  const std::uint64_t self_;
  PlaneRecord record_;
  std::uint64_t record_number_ = 0;
  std::uint64_t kept_ = 0;
  SectorBook sectors_;
  SectorClockWatch clock_watch_;
  PlaneView view_;
  HostInstant now_;
  HostInstant since_{INT64_MIN};  // the phase began
  std::uint64_t request_ = 0;     // that waits for the end; 0: none
  /// Changes of targets whose sectors have not carried them out yet.
  struct Retargeting {
    std::uint64_t request = 0;
    std::uint64_t change = 0;
    PositionerIndex unit;
  };
  std::vector<Retargeting> retargetings_;
  std::uint32_t tries_ = 0;          // rounds since the last exposure, or since a unit was homed
  std::size_t to_home_ = 0;          // units that were left to home in the last plan
  std::uint64_t job_ = 0;            // the last asked for
  std::uint64_t exposure_ = 0;       // the same
  std::uint64_t round_ = 0;          // the last given out, in this epoch
  std::vector<OutcomeCounts> told_;  // Shape: (sectors); last told of the configuration
  std::vector<PlanePart> parts_;     // Shape: (sectors)
  std::vector<std::uint8_t> strip_;  // Shape: (units); of the last job
  ConfigurationState end_ = ConfigurationState::kDone;
  PlaneEffects* out_ = nullptr;  // of the present step
};

}  // namespace focalfleet
