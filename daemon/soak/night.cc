#include "daemon/soak/night.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <utility>

#include "daemon/soak/virtual_time.h"

namespace focalfleet::soak {
namespace {

using enum FaultSite;

constexpr DurationNs kLookEvery = Milliseconds(100);
constexpr HostInstant kBegin{Seconds(1).ns};

FaultSite KillOf(TurnPoint point) {
  return static_cast<FaultSite>(Index(kKillGathered) + static_cast<std::size_t>(point));
}

PowerLimits PlanLimits(const Draws& draws) {
  return {.rail_W = draws.rail_motors * MotorAsMeasured_W()};
}

}  // namespace

Night::Night(const Draws& draws, const NightOptions& options)
    : draws_(draws),
      options_(options),
      now_(kBegin),
      start_at_(kBegin),
      frozen_until_(kBegin),
      look_at_(kBegin) {
  t_virtual_time = {.host_ns = kBegin.ns};
  result_.seed = draws.seed;
  plant_ = std::make_unique<Plant>(draws_);
  disk_ = std::make_unique<MemoryDisk>("focalfleet-soak");
  const std::size_t units = plant_->layout().size();
  troubles_.buses.assign(plant_->layout().buses().size(), Troubles::kLongAgo);
  troubles_.deaf.assign(units, Troubles::kLongAgo);
  troubles_.units.assign(units, Troubles::kLongAgo);
  troubles_.jumps.resize(units);
  troubles_.counts_lost.assign(units, Troubles::kLongAgo);
  judge_ = std::make_unique<Judge>(plant_.get(), disk_.get(), &troubles_, draws_,
                                   options.keep_days > 0 ? Extent::kState : Extent::kAll);
  faults_ = std::make_unique<FaultInjector>(
      FaultInjector::Parts{.draws = &draws_,
                           .plant = plant_.get(),
                           .disk = disk_.get(),
                           .troubles = &troubles_,
                           .reached = &reached_,
                           .host = [this](FaultSite site) { return OfHost(site); },
                           .daemon_lives = [this] { return life_ != nullptr; },
                           .tell = [this](const std::string& what) { Tell(what); }},
      now_);
  operators_ = std::make_unique<Operators>(Operators::Parts{
      .draws = &draws_,
      .plant = plant_.get(),
      .judge = judge_.get(),
      .troubles = &troubles_,
      .reached = &reached_,
      .put =
          [this](std::uint64_t client, const std::string& line) {
            if (life_ != nullptr) life_->Put(client, line);
          },
      .is_busy = [this] { return life_ != nullptr && life_->coordinator().busy(); }});
  disk_->fails = [this](DiskOperation operation) { return OfDisk(operation); };
}

int Night::OfDisk(DiskOperation operation) {
  const bool writes = operation == DiskOperation::kWrite || operation == DiskOperation::kSync;
  if (!death_.dying && death_.in_start && faults_->Happens(kKillInStart, 0.3))
    death_.dying = kKillInStart;
  if (!death_.dying && !death_.in_start && writes && faults_->Happens(kKillInCommit, 0.3)) {
    death_.dying = kKillInCommit;
    death_.power_cut = faults_->rng()->Below(2) == 0;
  }
  if (!death_.dying) return faults_->Disk(operation);
  disk_->Kill();
  return SQLITE_IOERR;
}

Surroundings Night::Around() {
  Surroundings around{.plant = plant_.get(), .disk = disk_.get()};
  around.passed = [this](TurnPoint point) { Passed(point); };
  around.port = {.sends = [this](BusId bus, const CanFrame& frame) { Sends(bus, frame); },
                 .is_full = [this] { return faults_->Happens(kPortFull, 30); }};
  around.commit_takes = [this] {
    const double factor = faults_->Acts(kDiskSlow) ? 50 : 1;
    const auto mean_ns = static_cast<double>(draws_.commit.ns) * factor;
    return DurationNs{1 + static_cast<std::int64_t>(mean_ns * faults_->rng()->Uniform(0.5, 1.5))};
  };
  around.plan_takes = [this] {
    if (faults_->Happens(kPlannerSlow, 50)) return Seconds(faults_->rng()->Uniform(5, 60));
    return draws_.plan;
  };
  around.planner_fails = [this] { return faults_->Happens(kPlannerFails, 50); };
  around.plan_limits = PlanLimits(draws_);
  around.keep_days = options_.keep_days;
  around.planner_has_room = [this] { return !faults_->Happens(kPlannerFull, 50); };
  around.reader_fails = [this] { return faults_->Happens(kStoreReaderFails, 20); };
  around.publisher_has_room = [this] { return !faults_->Happens(kReaderBehind, 20); };
  around.out = [this](ClientId client, std::string_view line, bool last) {
    return Hear(client, line, last);
  };
  around.commits = [this](std::span<const Row> rows) { judge_->Commits(rows); };
  around.committed = [this](std::span<const Row> rows, bool done) { Committed(rows, done); };
  around.published = [this](const StatusBatch& status) { judge_->Published(status); };
  around.starts = [this](const StoredFleet& stored, const CoordinatorConfig& config) {
    replayer_.reset();
    if (options_.replay)
      replayer_ = std::make_unique<journal::Replayer>(journal::Replayer::Start{
          &plant_->layout(), plant_->drives(), config, stored, PlanLimits(draws_)});
  };
  around.stepped = [this](const Inputs& inputs, const Effects& effects) {
    if (replayer_ == nullptr) return;
    const Status same = replayer_->Step(journal::RecordOf(inputs, effects));
    if (!same) judge_->Broken("replay", same.error().text);
  };
  around.log = [this](const std::string& text) {
    if (options_.log)
      options_.log(fmt::format("{:.6f} {}", 1e-9 * static_cast<double>(now_.ns), text));
  };
  if (draws_.camera)
    around.camera = [this] {
      return std::make_unique<NightCamera>(NightCamera::Options{
          .plant = plant_.get(),
          .rng = faults_->rng(),
          .happens = [this](FaultSite site) { return faults_->Happens(site, 50); },
          .log = Around().log});
    };
  return around;
}

void Night::Tell(const std::string& what) {
  if (options_.tell)
    options_.tell(fmt::format("{:9.3f} s  {}", 1e-9 * static_cast<double>(now_.ns), what));
}

void Night::Passed(TurnPoint point) {
  const bool in_danger = life_ != nullptr && life_->coordinator().busy();
  if (faults_->Happens(KillOf(point), in_danger ? 0.3 : 0.03)) throw Killed{KillOf(point)};
}

void Night::Committed(std::span<const Row> rows, bool done) {
  judge_->Committed(rows, done);
  ++(done ? result_.commits : result_.commits_failed);
  if (death_.dying) throw Killed{*death_.dying};
}

void Night::Sends(BusId bus, const CanFrame& frame) {
  if (faults_->Happens(kKillBetweenFrames, 0.3)) throw Killed{kKillBetweenFrames};
  judge_->Sends(bus, frame);
  faults_->Sent(bus, frame);
  ++result_.frames;
  const auto mix = [this](std::uint64_t word) { digest_ = (digest_ ^ word) * 0x100000001b3u; };
  mix(bus.value);
  mix(frame.id);
  mix(static_cast<std::uint64_t>(now_.ns));
  for (const std::uint8_t byte : frame.payload()) mix(byte);
}

bool Night::Hear(ClientId client, std::string_view line, bool last) {
  return operators_->Hear(client, line, last);
}

bool Night::OfHost(FaultSite site) {
  Rng& rng = *faults_->rng();
  const bool lived = life_ != nullptr;
  switch (site) {
    case kHostPowerCut:
      death_.power_cut = true;
      Die(site);
      return true;
    case kHostEnds:
      if (!lived) return false;
      Tell("the host is ended");
      try {
        static_cast<void>(life_->End());
        if (death_.dying) throw Killed{*death_.dying};
        Die(site);
      } catch (const Killed& killed) {
        Die(killed.site);
      }
      return true;
    case kHostFreeze:
      frozen_until_ = now_ + Seconds(0.05 * std::exp(rng.Uniform() * 6));
      Troubles::Until(frozen_until_ + Seconds(3), &troubles_.host);
      return lived;
    case kWallStepBack:
      t_virtual_time.wall_less_host_ns -= Seconds(rng.Uniform(1, 40'000)).ns;
      return lived;
    case kWallStepForward:
      t_virtual_time.wall_less_host_ns += Seconds(rng.Uniform(1, 40'000)).ns;
      return lived;
    default:
      return false;
  }
}

void Night::StartLife() {
  death_.in_start = true;
  judge_->LifeBegins();
  try {
    auto life = Life::Start(Around());
    if (death_.dying) throw Killed{*death_.dying};
    if (life) {
      life_ = std::move(*life);
      judge_->LifeHasBegun();
      ++result_.lives;
      Tell(fmt::format("life {} begins", result_.lives));
    } else {
      Tell("the daemon does not start: " + life.error().text);
      if (life.error().code == ErrorCode::kInvalid)
        judge_->Broken("start of the daemon", life.error().text);
      start_at_ = now_ + Seconds(1);
      disk_->Kill();
    }
  } catch (const Killed& killed) {
    Die(killed.site);
  }
  death_.in_start = false;
}

void Night::Die(FaultSite site) {
  Tell(fmt::format("the host dies at {}", Name(site)));
  if (std::exchange(death_.power_cut, false))
    disk_->CutPower(faults_->rng());
  else
    disk_->Kill();
  if (life_ != nullptr) result_.steps += life_->steps();
  life_.reset();
  death_.dying.reset();
  operators_->DaemonDied();
  start_at_ = now_ + Seconds(0.1 * std::exp(faults_->rng()->Uniform() * 5));
  Troubles::Until(start_at_ + Seconds(5), &troubles_.host);
}

void Night::TurnOfLife() {
  try {
    life_->Turn();
    if (death_.dying) throw Killed{*death_.dying};
    judge_->Queues(life_->writer().waiting(), life_->lines().Facts());
  } catch (const Killed& killed) {
    Die(killed.site);
  }
}

void Night::Look() {
  judge_->Look(now_);
  operators_->LookForUnanswered(now_);
  look_at_ = now_ + kLookEvery;
  if (!options_.tell || life_ == nullptr) return;
  const Coordinator& coordinator = life_->coordinator();
  std::size_t ready = 0, exact = 0;
  for (std::uint32_t n = 0; n < plant_->layout().size(); ++n) {
    ready += coordinator.unit({n}).phase == UnitPhase::kReady ? 1u : 0u;
    exact += IsPlace(coordinator.unit({n}).knowledge) ? 1u : 0u;
  }
  const ConfigurationView& c = coordinator.configuration();
  std::string state = fmt::format("ready {:3} exact {:3} store {} configuration {} {}{}", ready,
                                  exact, life_->writer().failing() ? "fails" : "well", c.id,
                                  Name(c.kind), coordinator.busy() ? " under way " : " over ");
  state += Name(c.state);
  if (state != state_) Tell(state);
  state_ = std::move(state);
}

void Night::RunUntil(HostInstant end, const std::function<bool()>& done) {
  while (now_ < end && judge_->broken().empty()) {
    HostInstant next = std::min({end, look_at_, faults_->next(), plant_->world().NextEvent()});
    next = std::min(next, life_ == nullptr ? start_at_ : operators_->next());
    if (life_ != nullptr && frozen_until_ <= now_) next = std::min(next, life_->wake_at());
    if (frozen_until_ > now_) next = std::min(next, frozen_until_);
    now_ = std::max(next, now_ + draws_.turn);
    t_virtual_time.host_ns = now_.ns;
    plant_->Advance(now_);
    if (faults_->next() <= now_) faults_->Apply(now_);
    if (life_ == nullptr && now_ >= start_at_) StartLife();
    const bool frozen = frozen_until_ > now_;
    if (life_ != nullptr && !done) operators_->Act(now_);
    if (life_ == nullptr)
      plant_->DropHeard();
    else if (!frozen && life_->wake_at() <= now_)
      TurnOfLife();
    if (life_ == nullptr || frozen) troubles_.away = now_;
    if (now_ >= look_at_) Look();
    if (done && done()) return;
  }
}

Liveness Night::SecondPhase() {
  return Liveness({.layout = &plant_->layout(),
                   .operators = operators_.get(),
                   .judge = judge_.get(),
                   .coordinator = [this] { return life_ ? &life_->coordinator() : nullptr; },
                   .run =
                       [this](double seconds, const std::function<bool()>& done) {
                         RunUntil(now_ + Seconds(seconds), done);
                       },
                   .tell = [this](const std::string& what) { Tell(what); }});
}

void Night::Converge() {
  Tell("liveness");
  faults_->Heal(now_);
  // The wall clock may be anywhere; people set it right.
  t_virtual_time.wall_less_host_ns =
      std::max(t_virtual_time.wall_less_host_ns, std::int64_t{1'700'000'000'000'000'000});
  SecondPhase().Converge();
  if (judge_->broken().empty()) operators_->LookAtEnd(now_);
}

NightResult Night::Run() {
  Tell("safety");
  RunUntil(now_ + draws_.safety);
  if (judge_->broken().empty()) Converge();
  return Finish();
}

NightResult Night::Finish() {
  if (life_ != nullptr) result_.steps += life_->steps();
  disk_->Kill();
  life_.reset();
  result_.broken = judge_->broken();
  result_.reached = reached_;
  result_.digest = (digest_ ^ operators_->digest()) * 0x100000001b3u;
  result_.virtual_s = 1e-9 * static_cast<double>(now_.ns);
  result_.answers = operators_->answers();
  for (std::size_t row = 0; row < plant_->layout().size(); ++row)
    result_.units_begun += plant_->world().Truth(row).moves_begun;
  return result_;
}

}  // namespace focalfleet::soak
