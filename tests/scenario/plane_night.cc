#include "tests/scenario/plane_night.h"

#include <algorithm>
#include <cstdio>
#include <memory>

#include "tests/scenario/plane_judge.h"

namespace focalfleet::test {
namespace {

// A fault lasts up to 8 s, so that sectors are missed in some nights and not in others.
constexpr double kFaultMost_s = 8;
// Phases that an earlier fault of the night often keeps away are drawn twice as often.
constexpr PlanePhase kPhases[] = {
    PlanePhase::kRecording, PlanePhase::kGathering, PlanePhase::kPlanning,  PlanePhase::kPreparing,
    PlanePhase::kPreparing, PlanePhase::kMoving,    PlanePhase::kFinishing, PlanePhase::kFinishing};

/// Units: s. A fault that is drawn for a phase is to strike in it, however short it is.
double LastsAbout(PlanePhase phase) {
  switch (phase) {
    case PlanePhase::kRecording:
      return 0.005;
    case PlanePhase::kGathering:
      return 0.4;
    case PlanePhase::kPlanning:
      return 0.1;
    case PlanePhase::kPreparing:
      return 0.25;
    case PlanePhase::kFinishing:
      return 0.02;
    case PlanePhase::kMeasuring:
      return 0.5;
    default:
      return 1.2;
  }
}

class Night {
 public:
  explicit Night(const PlaneNightOptions& options)
      : options_(options),
        rng_(Rng::Stream(options.seed, "night")),
        plane_({.sectors = static_cast<std::uint32_t>(2 + rng_.Below(3)),
                .units_per_sector = static_cast<std::uint32_t>(5 + rng_.Below(5)),
                .seed = options.seed,
                .times = {},
                .agent = {}}),
        judge_(&plane_) {
    plane_.commanded = [this](std::uint32_t sector, const SectorAgent& agent,
                              const Command& command) { judge_.Commanded(sector, agent, command); };
    plane_.looked = [this] { Looked(); };
    plane_.network.weather = {.lost = rng_.Uniform() < 0.5 ? 0 : rng_.Uniform(0, 0.1),
                              .doubled = rng_.Uniform(0, 0.1)};
    Draw();
  }

  PlaneNightResult Run() {
    result_.seed = options_.seed;
    // A coordinator claims the plane before it takes a configuration.
    armed_ = options_.fault && options_.phase == PlanePhase::kClaiming;
    if (!plane_.RunUntil([this] { return plane_.IsIdle(); }, Seconds(30)))
      Broken("no coordinator takes charge");
    const auto first = plane_.DrawTargets(2 * options_.seed);
    if (homes_)
      plane_.Give(PlaneHomeCommand{DrawUnits(), false});
    else if (measures_)
      plane_.Give(PlaneApplyCommand{"test", false, first, {}, ApplyCommand::Measure{1, 10, false}});
    else
      plane_.Apply(first);
    armed_ = true;
    const double lasts_s = rng_.Uniform(30, 120);
    const double retargets_after_s = tasks_.Uniform(0, 30);
    const bool retargets = !options_.fault && tasks_.Uniform() < 0.4;
    plane_.Run(Seconds(retargets_after_s));
    if (retargets && plane_.planes[0].coordinator != nullptr) Retarget();
    plane_.Run(Seconds(lasts_s - retargets_after_s));
    // Counts of a configuration are history where another coordinator has moved units since.
    if (plane_.IsIdle() && !second_ && !homes_ && !retargets && !measures_)
      judge_.LookAtArrivals(first);
    Heal();
    const auto second = plane_.DrawTargets(2 * options_.seed + 1);
    Converge(second);
    return Result();
  }

 private:
  struct Armed {
    PlaneFault fault = PlaneFault::kStorm;
    PlanePhase phase = PlanePhase::kMoving;
    double after_s = 0;
    double lasts_s = 0;
    std::uint32_t victim = 0;
    std::optional<HostInstant> at;  // once its phase was seen
    HostInstant ends = kNever;
    bool struck = false;
    bool over = false;
  };

  void Draw() {
    const std::uint64_t count = options_.fault ? 1 : 1 + rng_.Below(3);
    for (std::uint64_t n = 0; n < count; ++n) {
      Armed armed;
      armed.fault = options_.fault.value_or(static_cast<PlaneFault>(rng_.Below(kPlaneFaultCount)));
      armed.phase = options_.fault ? options_.phase : kPhases[rng_.Below(std::size(kPhases))];
      if (!options_.fault && measures_ && tasks_.Uniform() < 0.4)
        armed.phase = PlanePhase::kMeasuring;
      const bool motion = armed.phase == PlanePhase::kMoving;
      // Half of the faults in motion strike around the start, the others anywhere in it.
      armed.after_s = options_.fault                   ? options_.after_s
                      : motion && rng_.Uniform() < 0.5 ? rng_.Uniform(0, 25)
                                                       : rng_.Uniform(0, LastsAbout(armed.phase));
      armed.lasts_s = rng_.Uniform(0.05, kFaultMost_s);
      armed.victim = static_cast<std::uint32_t>(rng_.Below(plane_.layout().sectors()));
      armed_faults_.push_back(armed);
    }
  }

  /// Some units of the plane, in no order.
  std::vector<PositionerIndex> DrawUnits() {
    std::vector<PositionerIndex> units;
    const std::uint64_t count = 1 + tasks_.Below(6);
    for (std::uint64_t n = 0; n < count; ++n)
      units.push_back({static_cast<std::uint32_t>(tasks_.Below(plane_.layout().layout().size()))});
    return units;
  }
  /// Some units get other targets, which a draw for the whole plane has for them.
  void Retarget() {
    const auto other = plane_.DrawTargets(5 * options_.seed + 3);
    for (const PositionerIndex i : DrawUnits())
      plane_.Give(PlaneRetargetCommand{i, *other[i.value]});
  }

  void Tell(const std::string& what) {
    if (options_.tell)
      std::printf("%10.4f %s\n", 1e-9 * static_cast<double>(plane_.now().ns), what.c_str());
  }
  void Broken(const std::string& what) { result_.broken.push_back(what); }

  [[nodiscard]] std::optional<PlanePhase> Phase() const {
    if (plane_.planes[0].coordinator == nullptr) return std::nullopt;
    return plane_.planes[0].coordinator->view().phase;
  }

  void Looked() {
    judge_.Look();
    const auto phase = Phase();
    if (options_.tell) TellChanges();
    if (!armed_) return;
    // The second coordinator moves what it has, too.
    if (second_applies_ && plane_.IsIdle(1)) {
      second_applies_ = false;
      plane_.Apply(plane_.DrawTargets(3 * options_.seed + 7), 1);
    }
    plane_.look_at = kNever;
    for (Armed& armed : armed_faults_) {
      if (!armed.at && phase == armed.phase) armed.at = plane_.now() + Seconds(armed.after_s);
      if (armed.at && !armed.struck && plane_.now() >= *armed.at) Strike(&armed);
      if (armed.struck && !armed.over && plane_.now() >= armed.ends) End(&armed);
      if (armed.at && !armed.struck) plane_.look_at = std::min(plane_.look_at, *armed.at);
    }
  }

  void TellChanges() {
    const PlaneInProcess::Plane& at = plane_.planes[0];
    std::string state = at.coordinator == nullptr ? "dead" : Name(at.coordinator->view().phase);
    for (const PlaneInProcess::Sector& sector : plane_.sectors)
      state += sector.coordinator == nullptr
                   ? " dead"
                   : std::string(" ") + Name(sector.coordinator->sector().stage);
    if (state != printed_) Tell(printed_ = state);
    for (const PlaneInProcess::Plane& one : plane_.planes) {
      std::size_t& printed = printed_log_[&one == &plane_.planes[0] ? 0 : 1];
      for (; printed < one.log.size(); ++printed) Tell("  " + one.log[printed]);
    }
    for (std::size_t n = 0; n < plane_.sectors.size(); ++n) {
      printed_notes_.resize(plane_.sectors.size());
      for (; printed_notes_[n] < plane_.sectors[n].notes.size(); ++printed_notes_[n])
        Tell("  sector " + std::to_string(n) + ": " +
             plane_.sectors[n].notes[printed_notes_[n]].text);
    }
  }

  static bool IsOfOneSector(PlaneFault fault) {
    return fault == PlaneFault::kKillSector || fault == PlaneFault::kCutSector ||
           fault == PlaneFault::kCutSectorMuted || fault == PlaneFault::kCutSectorDeaf ||
           fault == PlaneFault::kStopSector || fault == PlaneFault::kHaltUnit;
  }

  void Isolate(std::uint32_t node, bool from, bool to, HostInstant until) {
    const std::uint32_t nodes =
        plane_.layout().sectors() + static_cast<std::uint32_t>(plane_.planes.size());
    for (std::uint32_t other = 0; other < nodes; ++other) {
      if (from) plane_.network.Cut(node, other, until);
      if (to) plane_.network.Cut(other, node, until);
    }
  }

  void Strike(Armed* armed) {
    armed->struck = true;
    armed->ends = plane_.now() + Seconds(armed->lasts_s);
    const auto phase = Phase();
    if (phase)
      ++result_.struck[static_cast<std::size_t>(armed->fault)][static_cast<std::size_t>(*phase)];
    Tell(std::string("FAULT ") + Name(armed->fault) + " at sector " +
         std::to_string(armed->victim));
    judge_.Struck(IsOfOneSector(armed->fault) ? std::optional(armed->victim) : std::nullopt);
    const std::uint32_t sectors = plane_.layout().sectors();
    const std::uint32_t beside = armed->victim == 0 ? 1 : armed->victim - 1;
    switch (armed->fault) {
      case PlaneFault::kKillSector:
        plane_.KillSector(armed->victim);
        break;
      case PlaneFault::kKillPlane:
        plane_.KillPlane();
        break;
      case PlaneFault::kKillBoth:
        plane_.KillPlane();
        plane_.KillSector(armed->victim);
        break;
      case PlaneFault::kCutSector:
        Isolate(armed->victim, true, true, armed->ends);
        break;
      case PlaneFault::kCutSectorMuted:
        Isolate(armed->victim, true, false, armed->ends);
        break;
      case PlaneFault::kCutSectorDeaf:
        Isolate(armed->victim, false, true, armed->ends);
        break;
      case PlaneFault::kCutBorder:
        plane_.network.Cut(armed->victim, beside, armed->ends);
        break;
      case PlaneFault::kStorm:
        plane_.network.weather = {.lost = 0.4, .doubled = 0.2, .delay_most = Milliseconds(300)};
        break;
      case PlaneFault::kSecondPlane:
        second_ = true;
        plane_.StartPlane(1, true);
        break;
      case PlaneFault::kSecondPlaneCut:
        armed->ends = plane_.now() + Seconds(3 * armed->lasts_s);
        second_ = true;
        plane_.StartPlane(1, true);
        // The first has the sectors up to the victim, the second the others.
        for (std::uint32_t n = 0; n < sectors; ++n) {
          const std::uint32_t not_mine = plane_.Node(n <= armed->victim ? 1 : 0);
          plane_.network.Cut(n, not_mine, armed->ends);
          plane_.network.Cut(not_mine, n, armed->ends);
          for (std::uint32_t other = 0; other < sectors; ++other)
            if ((n <= armed->victim) != (other <= armed->victim))
              plane_.network.Cut(n, other, armed->ends);
        }
        second_applies_ = true;
        break;
      case PlaneFault::kStop:
        if (plane_.planes[0].coordinator != nullptr) plane_.Stop();
        break;
      case PlaneFault::kStopSector:
        if (plane_.sectors[armed->victim].coordinator != nullptr)
          plane_.sectors[armed->victim].commands.push_back({1, StopCommand{}});
        break;
      case PlaneFault::kHaltUnit: {
        const auto own = plane_.layout().own(armed->victim);
        for (const PositionerIndex i : own)
          if (plane_.world().Truth(i.value).state == UnitState::kMoving &&
              !plane_.layout().beyond(i).empty()) {
            halted_.push_back(i);
            plane_.world().disturb().RaiseFault(plane_.layout().layout().unit(i).id,
                                                FaultCode::kDriver);
            break;
          }
        break;
      }
    }
  }

  void End(Armed* armed) {
    armed->over = true;
    Tell(std::string("over  ") + Name(armed->fault));
    switch (armed->fault) {
      case PlaneFault::kKillSector:
        plane_.StartSector(armed->victim);
        break;
      case PlaneFault::kKillPlane:
        plane_.StartPlane();
        break;
      case PlaneFault::kKillBoth:
        plane_.StartPlane();
        plane_.StartSector(armed->victim);
        break;
      case PlaneFault::kStorm:
        plane_.network.weather = {};
        break;
      case PlaneFault::kSecondPlaneCut:
        // Each side has worked on its own; whoever is left is the first coordinator.
        plane_.KillPlane(1);
        break;
      default:
        break;
    }
  }

  void Heal() {
    Tell("all faults end");
    for (Armed& armed : armed_faults_)
      if (armed.struck && !armed.over) End(&armed);
    armed_ = false;
    plane_.network.Heal();
    plane_.KillPlane(1);
    plane_.StartPlane(0);
    for (std::uint32_t n = 0; n < plane_.sectors.size(); ++n) plane_.StartSector(n);
    if (!plane_.RunUntil([this] { return plane_.IsIdle(); }, Seconds(400)))
      Broken("the first configuration does not end: " + std::string(Name(*Phase())) +
             ", waits for " + plane_.plane().view().waiting_for);
    plane_.Run(Seconds(8));  // a sector's next life hears of the configuration
    LookAtFates();
    // An operator clears the faults of units.
    for (const PositionerIndex i : halted_) {
      const UnitId id = plane_.layout().layout().unit(i).id;
      plane_.world().disturb().PowerCut(id);
      plane_.Run(Seconds(1));
      plane_.world().disturb().PowerOn(id);
    }
    plane_.Run(Seconds(8));
    for (const PositionerIndex i : halted_)
      plane_.sectors[plane_.layout().SectorOf(i)].commands.push_back(
          {2, EnableCommand{{plane_.layout().Local(i)}, true, {}}});
    plane_.Run(Seconds(5));
    judge_.LookAtStores();
  }

  void LookAtFates() {
    result_.rounds = plane_.plane().view().rounds;
    for (std::uint32_t n = 0; n < plane_.layout().layout().size(); ++n) {
      const bool victim = plane_.layout().SectorOf({n}) == armed_faults_[0].victim;
      PlaneFate& fate = victim ? result_.victims : result_.others;
      ++fate.units;
      ++fate.outcomes[static_cast<std::size_t>(plane_.unit({n}).outcome)];
    }
  }

  void Converge(const std::vector<std::optional<Pose>>& targets) {
    Tell("the last configuration");
    plane_.Apply(targets);
    if (!plane_.RunUntil([this] { return !plane_.IsIdle(); }, Seconds(5)) ||
        !plane_.RunUntil([this] { return plane_.IsIdle(); }, Seconds(600)))
      Broken("the last configuration does not end: " + std::string(Name(*Phase())) +
             ", waits for " + plane_.plane().view().waiting_for);
    plane_.Run(Seconds(2));
    judge_.LookAtStores();
    judge_.LookAtArrivals(targets);
    std::uint32_t lost = 0;
    for (std::uint32_t n = 0; n < targets.size(); ++n)
      lost += IsPlace(plane_.unit({n}).knowledge) ? 0u : 1u;
    const OutcomeCounts& counts = plane_.plane().view().counts;
    result_.completed = counts.arrived;
    // Units beside one of unknown place may find no way.
    if (counts.arrived != targets.size() && halted_.empty() && lost == 0) {
      Broken("the last configuration is not whole: " + std::to_string(counts.arrived) + " of " +
             std::to_string(targets.size()));
      for (std::uint32_t n = 0; n < targets.size(); ++n)
        if (plane_.unit({n}).outcome != TargetOutcome::kArrived)
          Broken("unit " + std::to_string(n + 1) + " " + Name(plane_.unit({n}).phase) + " " +
                 Name(plane_.unit({n}).outcome) + " " + plane_.unit({n}).outcome_reason);
    }
    if (lost > halted_.size()) Broken(std::to_string(lost) + " units have no place");
  }

  PlaneNightResult Result() {
    for (const std::string& broken : judge_.broken()) Broken(broken);
    result_.begun = judge_.begun();
    result_.starts = judge_.starts();
    result_.nearest_mm = judge_.nearest_mm();
    result_.excused = judge_.excused();
    result_.sent = plane_.network.sent;
    result_.virtual_s = 1e-9 * static_cast<double>(plane_.now().ns);
    result_.digest = 0xcbf29ce484222325u;
    const auto add = [this](std::uint64_t word) {
      result_.digest = (result_.digest ^ word) * 0x100000001b3u;
    };
    add(result_.begun);
    add(result_.sent);
    add(static_cast<std::uint64_t>(plane_.now().ns));
    for (std::uint32_t n = 0; n < plane_.layout().layout().size(); ++n)
      for (const double vectors : plane_.world().Truth(n).vectors)
        add(static_cast<std::uint64_t>(static_cast<std::int64_t>(vectors * 1000)));
    for (const PlaneInProcess::Sector& sector : plane_.sectors)
      for (const ShellNote& note : sector.notes) {
        result_.missed += note.name == AlarmName::kSectorStartMissed ? 1 : 0;
        result_.silent += note.name == AlarmName::kSectorSilent ? 1 : 0;
      }
    return std::move(result_);
  }

  const PlaneNightOptions options_;
  Rng rng_;
  Rng tasks_ = Rng::Stream(options_.seed, "tasks");
  const bool homes_ = !options_.fault && tasks_.Uniform() < 0.25;
  const bool measures_ = options_.fault ? options_.phase == PlanePhase::kMeasuring
                                        : !homes_ && tasks_.Uniform() < 0.25;
  PlaneInProcess plane_;
  PlaneJudge judge_;
  std::vector<Armed> armed_faults_;
  bool armed_ = false;
  bool second_ = false;  // there was another coordinator
  bool second_applies_ = false;
  std::vector<PositionerIndex> halted_;
  PlaneNightResult result_;
  std::string printed_;
  std::array<std::size_t, 2> printed_log_{};
  std::vector<std::size_t> printed_notes_;
};

}  // namespace

const char* Name(PlaneFault fault) {
  constexpr const char* kNames[kPlaneFaultCount] = {
      "kill_sector", "kill_plane",  "kill_both", "cut_sector",   "muted_sector",
      "deaf_sector", "cut_border",  "storm",     "second_plane", "second_plane_cut",
      "stop",        "stop_sector", "halt_unit"};
  return kNames[static_cast<std::size_t>(fault)];
}

PlaneNightResult RunPlaneNight(const PlaneNightOptions& options) { return Night(options).Run(); }

}  // namespace focalfleet::test
