// A configuration is a goal, and this pursues it in rounds:
//
//   gathering -> planning -> uploading -> committing -> moving -> (next round, homing, or finished)
//                   ^             |                        |
//                   +-------------+------------------------+   somebody fell out: plan around it
//
// A goal that is measured goes past each target first and comes to it by a last short way of one
// direction (executor_approach.cc), then looks with the camera and does the same again for those
// that are too far off (executor_measure.cc).
//
// Nothing starts before every unit of the plan holds its move, and before the store holds the
// intent of each. A unit that falls out before the start costs a new plan; one that falls out in
// motion stops those whose way leads through where it may stand (UnitPlan::followers), and the next
// round takes them on, unless they find a way while the others still move (executor_late.cc). Every
// round and every late move uses a new move id, so a unit that kept an old move never starts with
// the others.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "fleet/coordinate/core.h"
#include "fleet/coordinate/play.h"
#include "fleet/coordinate/start_skew.h"
#include "fleet/coordinate/unit_session.h"

namespace focalfleet {

class ConfigurationExecutor {
 public:
  ConfigurationExecutor(Core* core, UnitSessions* sessions);

  Status Apply(std::uint64_t request, const ApplyCommand& command);
  /// Another target for one unit while the others move.
  Status Retarget(std::uint64_t request, const RetargetCommand& command);
  Status Home(std::uint64_t request, const HomeCommand& command);
  /// One look by camera or sensors; nobody moves.
  Status Measure(std::uint64_t request);
  void StopAll() { StopAll("stopped by the operator"); }
  /// By the operator: it takes no further part in this goal.
  void StopUnit(PositionerIndex i);

  /// The daemon ends: the configuration that is under way ends with the counts that it has.
  void GiveUp();
  /// Configurations that an earlier run could not end: nobody pursues them any more.
  void EndThoseOfAnEarlierRun();

  void OnPlan(const PlanDone& done);
  void OnExposure(const ExposureDone& done);
  void OnConfirm(PositionerIndex i, const ConfirmReply& reply);
  void OnArm(PositionerIndex i, const ArmReply& reply);
  void OnHomeReply(PositionerIndex i, const HomeReply& reply);
  /// Takes what happened to units since the last call, then moves on if it can.
  void Advance();

  [[nodiscard]] const ConfigurationView& view() const { return view_; }
  [[nodiscard]] bool busy() const { return state_ != State::kIdle; }
  [[nodiscard]] HostInstant due() const { return std::min(due_, late_due_); }
  /// The plan that `i` is carrying out now, and when its clock of the plan began.
  struct Course {
    const UnitPlan* plan = nullptr;
    HostInstant began;
  };
  [[nodiscard]] std::optional<Course> CourseOf(PositionerIndex i) const;
  /// Its nominal end may be over by the quickest clock.
  [[nodiscard]] bool MayHaveArrived(const Course& course) const;

 private:
  enum class State : std::uint8_t {
    kIdle,
    kGathering,  // waiting until everybody has had the chance to answer
    kPlanning,
    kUploading,
    kDisarming,  // somebody fell out before the start: the others give their moves back
    kCommitting,
    kMoving,
    kHomeCommitting,
    kHoming,
    kMeasuring,  // all rest, the camera looks
    kReporting,  // all motion is over; the last rows are being written
  };
  /// Where a unit is in this round.
  enum class Part : std::uint8_t { kNone, kWaiting, kUploading, kHolding, kMoving };

  /// A late move in the making (executor_late.cc).
  struct Late {
    enum class Stage : std::uint8_t {
      kSettling,  // it was moving, or gives a move back
      kPlanning,
      kUploading,
      kCommitting,
      kStarting,
      kStarted,  // the start is said some more times
    };
    PositionerIndex unit;
    std::uint64_t request = 0;  // 0: nobody asked, it goes on to the target that it had
    Stage stage = Stage::kSettling;
    int tries = 0;
    std::uint64_t job = 0;
    std::vector<Deviation> near;  // of its neighbours, when it was planned
    PlanPrediction predicted;
    std::uint64_t batch = 0;  // of its intent
    int starts_said = 0;
    HostInstant say_start_at{INT64_MIN};
  };
  /// A late move from when it is planned until the round is over or it gets another.
  struct LateCourse {
    LateMove late;
    MoveId move;
  };

  void Begin(std::uint64_t request, ConfigurationKind kind, std::string source);
  [[nodiscard]] bool CanMeasure() const;
  void Gather();
  void GatherIfDue();
  void BeginRound();
  void TakePlan(const PlanDone& done);
  void PumpUploads();
  void Upload(PositionerIndex i);
  /// Appends what the host stages to `staged`; returns the bits of the rest.
  std::uint32_t UploadBits(PositionerIndex i, std::vector<CanFrame>* staged) const;
  void PredictUpload();
  void MeasureUpload();
  void FallOut(PositionerIndex i, const std::string& reason);
  void UploadsOver();
  void Disarm();
  void CommitRound();
  void Intend(PositionerIndex i, const IntentRow& intent, const Pose& offset);
  void TakeBackIntent(PositionerIndex i);
  void TakeBackIntents();
  void Start();
  void RepeatStart();
  void ExpectStarts();
  void NoteStart(PositionerIndex i);
  [[nodiscard]] bool AwaitsStart(PositionerIndex i) const;
  void JudgeStarts();
  void RoundOver();
  void CommitHoming();
  void StartHoming();
  void FinishWhenDurable(ConfigurationState end);
  void Finish();
  void StopAll(const std::string& reason);
  void StoppedBySomebodyElse(PositionerIndex i);
  void Exclude(PositionerIndex i);
  void Strike(PositionerIndex i, const std::string& reason);
  void StopOne(PositionerIndex i, const std::string& reason);
  void Take(const UnitEvent& event);
  void Settled(PositionerIndex i, UnitEventKind how);
  /// When a unit may have ended, both included.
  struct Ended {
    HostInstant from;
    HostInstant until;
  };
  [[nodiscard]] Ended SeenUntil(PositionerIndex i, HostInstant until) const;
  void StopFollowers(PositionerIndex first, const Ended& ended, const std::string& reason);
  void SetWatch(PositionerIndex i);
  void WatchLeader(PositionerIndex i);
  void WatchSoon(PositionerIndex i);
  Late* FindLate(PositionerIndex i);
  [[nodiscard]] MoveId MoveOf(PositionerIndex i) const;
  [[nodiscard]] HostInstant BeganOf(PositionerIndex i) const;
  [[nodiscard]] std::optional<Deviation> DeviationOf(PositionerIndex i) const;
  [[nodiscard]] std::vector<Deviation> Deviations() const;
  [[nodiscard]] std::vector<Deviation> DeviationsNear(PositionerIndex i) const;
  [[nodiscard]] bool IsStale(const Late& late) const;
  [[nodiscard]] bool StandsAt(PositionerIndex i, const Pose& from) const;
  [[nodiscard]] bool IsUnheard(const LateMove& late) const;
  Status MayRetarget(const RetargetCommand& command);
  void GoOnLate(PositionerIndex i);
  void AdvanceLate();
  bool AdvanceOne(Late* late);
  bool Settle(Late* late);
  void PlanLate(Late* late);
  void OnLatePlan(const PlanDone& done);
  void TakeLate(Late* late, const LateMove& move);
  void ReportOtherLate(PositionerIndex i);
  bool TryAgain(Late* late);
  void Withdraw(PositionerIndex i);
  bool Load(Late* late);
  void StartLate(Late* late);
  void SayStart(Late* late);
  void EndLate(const Late& late, Error error);
  void EndAllLate(const std::string& reason);
  [[nodiscard]] bool RoundIsOver() const;
  void SetOutcome(PositionerIndex i, TargetOutcome outcome, std::string reason = {});
  [[nodiscard]] std::uint32_t* CountOf(TargetOutcome outcome);
  void SetPart(PositionerIndex i, Part part);
  void SetState(State state);
  void JudgeTargets();
  [[nodiscard]] std::vector<Pose> PastTarget(PositionerIndex i, const Pose& target) const;
  [[nodiscard]] std::vector<Pose> AsideOf(PositionerIndex i) const;
  void NoteDirections(PositionerIndex i, const UnitPlan* reached);
  bool GoPast(std::vector<std::optional<Pose>>* targets);
  void MeasureOrFinish();
  /// What an exposure is for.
  enum class Look : std::uint8_t {
    kBefore,  // units of unknown place are to be found before anybody moves
    kAfter,   // all have arrived
    kOnly,    // nothing else was asked for
  };
  void StartLook(Look look);
  [[nodiscard]] bool LooksFirst() const;
  [[nodiscard]] bool IsLocating() const;
  void ExposureFailed(const Error& error);
  void LookIsOver();
  void JudgeMeasured();
  [[nodiscard]] bool IsWithinTolerance(PositionerIndex i) const;
  [[nodiscard]] std::string WhyNotMeasured(PositionerIndex i) const;
  [[nodiscard]] bool SensorsAreRead();
  void AskForExposure();
  void TakeFibreCarrier(PositionerIndex i, const Measurement& measurement);
  void TakeMeasurement(const ExposureFindings& exposure, const Measurement& measurement,
                       MeasuredRound* round);
  bool Correct();
  [[nodiscard]] std::vector<Pose> AimsOf(PositionerIndex i) const;
  [[nodiscard]] bool NeedsRunUp(PositionerIndex i, Axis axis, std::int32_t left) const;
  [[nodiscard]] std::int32_t RunUpOf(PositionerIndex i, Axis axis) const;
  [[nodiscard]] std::int8_t SideAfter(PositionerIndex i, Axis axis, std::int32_t left) const;
  [[nodiscard]] Pose NextOf(PositionerIndex i) const;
  void SetNext();
  [[nodiscard]] bool Waits(PositionerIndex i) const;
  [[nodiscard]] Pose GoalFor(PositionerIndex i, const Pose& target) const;
  void NoteWhoHasNoRoom();
  bool AnotherWave();
  [[nodiscard]] MeasurementRow RowOf(const ExposureFindings& exposure,
                                     const Measurement& measurement) const;
  [[nodiscard]] double ScatterDeg(double way_deg) const;
  [[nodiscard]] Pose LastAimOf(PositionerIndex i, const Pose& goal,
                               const std::array<bool, kAxisCount>& runs_up) const;
  [[nodiscard]] std::string WhyItStays(PositionerIndex i) const;
  void Reopen(PositionerIndex i);
  void SendAgain(PositionerIndex i);
  void ReportArrivals();
  void Record();
  void CountPrediction();
  void SayWhatIsWaitedFor();
  [[nodiscard]] HostInstant AtPlanTime(double t_s) const { return view_.started + Seconds(t_s); }
  [[nodiscard]] StagedMove StagedMoveOf(PositionerIndex i) const;
  [[nodiscard]] IntentRow IntentOf(PositionerIndex i) const;
  [[nodiscard]] IntentRow HomingIntentOf(PositionerIndex i) const;
  [[nodiscard]] Plan HomingMotion() const;

  static constexpr std::size_t kNoPlan = SIZE_MAX;

  Core& core_;
  UnitSessions& sessions_;
  State state_ = State::kIdle;
  ConfigurationView view_;
  std::uint64_t request_ = 0;
  bool fixed_ = false;
  bool unproven_ = false;
  bool stopping_ = false;
  ConfigurationState end_ = ConfigurationState::kDone;
  /// The targets of the goal, as near as the units get, theta in the whole turn that is taken.
  std::vector<std::optional<Pose>> goals_;
  /// Where they are to end: the goals, or short of them where a correction follows.
  std::vector<std::optional<Pose>> targets_;
  // Of a goal that is measured.
  std::optional<ApplyCommand::Measure> measure_;
  std::vector<std::array<AxisPlay, kAxisCount>> play_;
  /// Of a correction: where a unit is to end, and on which side of their play its axes were
  /// measured. None: not measured, or blind.
  struct Approach {
    Pose aim{};
    std::array<std::int8_t, kAxisCount> side{};
    bool has_no_room =
        false;  // its neighbours leave none for the correction, or for its unidirectional approach
  };
  std::vector<std::optional<Approach>> approaches_;
  int waves_left_ = 0;                // of this correction
  std::uint64_t settled_batch_ = 0;   // with which the last motion's end becomes durable
  std::uint64_t measured_batch_ = 0;  // with which the last exposure becomes durable; 0: none
  std::uint8_t corrections_left_ = 0;
  bool goes_past_ = false;                  // this leg ends past the targets
  bool sets_out_ = false;                   // the next round is the first since the last exposure
  std::vector<std::optional<Pose>> stood_;  // before they were sent off
  std::vector<std::string> target_ids_;     // Shape: (n), or empty
  std::vector<HostInstant> ended_;          // its last motion, as it was heard; kNever: not known
  HostInstant exposure_asked_;
  std::uint64_t exposure_ = 0;
  HostInstant sense_at_ = kNever;  // the sensors of units are read from then on
  HostInstant sense_until_{0};     // who is read anew is awaited until then
  bool sensing_ = false;           // and are being read
  int exposures_refused_ = 0;
  Look look_ = Look::kAfter;
  bool looked_first_ = false;
  bool is_locating_ = false;  // the counts of units that were found are being set

  std::vector<PositionerIndex> to_home_;
  std::vector<std::uint8_t> excluded_;  // failed in this goal: stands still from then on
  std::vector<std::uint8_t> strikes_;
  std::string failure_;
  struct Before {
    UnitKnowledge knowledge;
    Pose offset{};
  };
  std::vector<std::optional<Before>> before_;  // what was known before an intent not yet begun

  // this round
  std::uint64_t job_ = 0;
  Plan plan_;
  MoveId move_;
  std::vector<std::size_t> plan_of_;  // by unit; kNoPlan
  std::vector<Part> part_;
  std::vector<std::uint8_t> stage_tries_;
  std::array<std::uint32_t, 5> parts_{};              // how many units are in each part
  std::vector<std::deque<PositionerIndex>> waiting_;  // by bus: to be uploaded
  std::vector<std::uint32_t> uploading_;              // by bus
  std::vector<PositionerIndex> homing_;
  // What this round's motion is predicted to take and draw; added to the view when it starts.
  PlanPrediction prediction_;
  // Late moves, and what they are planned with.
  std::shared_ptr<const RunningPlan> running_;
  std::vector<Late> late_;
  std::unordered_map<std::uint32_t, LateCourse> courses_;  // by unit
  std::vector<std::uint8_t> goes_on_;  // how often a unit was taken up again in this round
  std::uint64_t late_job_ = 0;         // under way; 0: none
  HostInstant late_due_ = kNever;
  double round_end_s_ = 0;  // predicted, after the start signal
  std::uint64_t commit_batch_ = 0;
  // When the units of this round began; what it was planned for, and what the next one will be:
  // any unit may start so much early or late.
  StartSkew skew_;
  double round_skew_s_ = PlanOptions{}.start_skew_s;
  double planned_skew_s_ = PlanOptions{}.start_skew_s;
  HostInstant last_arrival_;
  HostInstant start_repeat_ = kNever;
  int start_repeats_ = 0;
  HostInstant due_ = kNever;
  HostInstant gather_until_ = kNever;
  std::uint64_t frames_before_ = 0;

  // arrivals that are not durable yet: not told before they are
  struct Arrival {
    std::uint64_t batch;
    PositionerIndex unit;
  };
  std::deque<Arrival> arrivals_;
};

}  // namespace focalfleet
