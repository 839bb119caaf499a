#include "tests/scenario/plane_in_process.h"

#include <algorithm>
#include <utility>

#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"

namespace focalfleet::test {
namespace {

constexpr DurationNs kTurn = Microseconds(200);

// Strips across x, each a bus of its own.
std::vector<focalfleet::Unit> Strips(std::uint32_t sectors, std::uint32_t units_per_sector) {
  std::vector<focalfleet::Unit> units =
      MakeHexLayout({.count = sectors * units_per_sector, .units_per_bus = units_per_sector});
  std::ranges::sort(units, [](const auto& a, const auto& b) {
    return std::pair(a.base_fp.x_mm, a.base_fp.y_mm) < std::pair(b.base_fp.x_mm, b.base_fp.y_mm);
  });
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    units[n].id.value = n + 1;
    units[n].bus = {n / units_per_sector};
    units[n].node = {static_cast<std::uint8_t>(n % units_per_sector + 1)};
  }
  return units;
}

/// The places of all units, as the seat of a sector gives them; null: something is under way.
std::shared_ptr<const SectorPlaces> PlacesOf(const PlaneInProcess::Sector& sector) {
  if (sector.coordinator->sector().stage != SectorStage::kIdle) return nullptr;
  auto places = std::make_shared<SectorPlaces>();
  const auto drives = sector.coordinator->drives();
  places->drives.assign(drives.begin(), drives.end());
  for (std::uint32_t n = 0; n < drives.size(); ++n)
    places->places.push_back(sector.coordinator->unit({n}).knowledge);
  return places;
}

}  // namespace

PlaneInProcess::PlaneInProcess(const Options& options)
    : network(Rng::Stream(options.seed, "network")), options_(options) {
  auto whole = Layout::Create(Strips(options.sectors, options.units_per_sector), {});
  FOCALFLEET_CHECK(whole.has_value());
  std::vector<std::vector<BusId>> buses(options.sectors);
  for (std::uint32_t n = 0; n < options.sectors; ++n) buses[n] = {BusId{n}};
  auto plane = PlaneLayout::Create(std::move(*whole), buses);
  FOCALFLEET_CHECK(plane.has_value());
  layout_ = std::make_unique<PlaneLayout>(std::move(*plane));
  const Layout& layout = layout_->layout();
  drives_.assign(layout.size(), UnitDrive{});
  const auto start = DrawConfiguration(layout, drives_, {}, Rng::Stream(options.seed, "start"));
  FOCALFLEET_CHECK(start.has_value());
  sim::WorldConfig config{
      .units = DescribeUnits(layout), .seed = options.seed, .spread = options.spread, .faults = {}};
  for (std::uint32_t n = 0; n < layout.size(); ++n)
    for (const Axis axis : kAxes)
      config.units[n].axis[Index(axis)].angle_deg =
          AngleDeg((*start)[n][Index(axis)], layout.units()[n].axis[Index(axis)],
                   drives_[n].axis[Index(axis)]);
  config.start = now_;
  FOCALFLEET_CHECK(sim::World::Validate(config).has_value());
  world_ = std::make_unique<sim::World>(std::move(config));
  Rng clocks = Rng::Stream(options.seed, "clocks");
  const auto ahead = [&] { return Seconds(clocks.Uniform(0, options.clock_ahead_most.seconds())); };
  sectors.resize(options.sectors);
  for (std::uint32_t n = 0; n < options.sectors; ++n) {
    Sector& sector = sectors[n];
    auto part = layout.Part(layout_->own(n));
    FOCALFLEET_CHECK(part.has_value());
    sector.layout = std::make_unique<Layout>(std::move(*part));
    sector.drives.assign(sector.layout->size(), UnitDrive{});
    sector.storage = DelayedStore(options.commit_delay);
    sector.ahead = ahead();
    sector.drift = clocks.Uniform(-options.drift_most, options.drift_most);
    for (const BusId bus : sector.layout->buses()) sector.controllers.emplace_back(bus);
    StartSector(n);
  }
  for (Plane& plane_node : planes) {
    plane_node.ahead = ahead();
    plane_node.camera = DelayedCamera(options.camera);
  }
  StartPlane(0);
}

HostInstant PlaneInProcess::OfSector(const Sector& sector, HostInstant at) const {
  return at + sector.ahead +
         DurationNs{static_cast<std::int64_t>(sector.drift * static_cast<double>(at.ns))};
}

// ---- lives and deaths

void PlaneInProcess::KillSector(std::uint32_t which) {
  Sector& sector = sectors[which];
  sector.coordinator.reset();
  sector.agent.reset();
  sector.storage.Restart();
  sector.keep.reset();
  sector.last.Clear();
  sector.orders.clear();
  sector.news.clear();
  sector.frames.clear();
  sector.commands.clear();
}

void PlaneInProcess::StartSector(std::uint32_t which) {
  Sector& sector = sectors[which];
  if (sector.coordinator != nullptr) return;
  CoordinatorConfig config;
  config.in_plane = true;
  config.has_camera = true;  // the plane's
  sector.coordinator = std::make_unique<Coordinator>(sector.layout.get(), sector.drives, config,
                                                     sector.storage.memory().fleet);
  SectorAgentConfig agent = options_.agent;
  agent.sector = which;
  agent.layout = DigestOf(*sector.layout);
  agent.start_delay = config.start_delay;
  sector.agent = std::make_unique<SectorAgent>(agent, ++sector.life, sector.kept);
  sector.wake = now_;
}

void PlaneInProcess::KillPlane(std::uint32_t which) {
  Plane& at = planes[which];
  at.coordinator.reset();
  at.keep.reset();
  at.job.reset();
  at.camera.Restart();
  at.reports.clear();
  at.commands.clear();
}

void PlaneInProcess::StartPlane(std::uint32_t which, bool forget) {
  Plane& at = planes[which];
  if (at.coordinator != nullptr) return;
  if (forget) at.kept = {};
  at.kept_number = 0;
  at.job_due = kNever;
  at.coordinator =
      std::make_unique<PlaneCoordinator>(layout_.get(), options_.times, 1000 + which, at.kept);
  at.wake = now_;
}

std::vector<std::optional<Pose>> PlaneInProcess::DrawTargets(std::uint64_t seed) const {
  const auto poses =
      DrawConfiguration(layout_->layout(), drives_, {}, Rng::Stream(seed, "targets"));
  FOCALFLEET_CHECK(poses.has_value());
  return {poses->begin(), poses->end()};
}

std::uint64_t PlaneInProcess::Apply(std::vector<std::optional<Pose>> targets, std::uint32_t which) {
  return Give(PlaneApplyCommand{"test", false, std::move(targets), {}}, which);
}

std::uint64_t PlaneInProcess::Give(decltype(PlaneCommand::what) what, std::uint32_t which) {
  const std::uint64_t request = next_request_++;
  planes[which].commands.push_back({request, std::move(what)});
  return request;
}

const ReplyEffect* PlaneInProcess::ReplyTo(std::uint64_t request, std::uint32_t which) const {
  const auto& replies = planes[which].replies;
  const auto it =
      std::ranges::find(replies.rbegin(), replies.rend(), request, &ReplyEffect::request);
  return it == replies.rend() ? nullptr : &*it;
}

void PlaneInProcess::Stop(std::uint32_t which) { Give(PlaneStopCommand{}, which); }

// ---- turns

void PlaneInProcess::TurnSector(std::uint32_t which) {
  Sector& sector = sectors[which];
  const HostInstant now = OfSector(sector, now_);
  if (sector.keep && now_ >= sector.keep_at) sector.kept = *std::exchange(sector.keep, {});
  sector.storage.CommitDue(now_);
  const bool due = !sector.orders.empty() || !sector.news.empty() || !sector.frames.empty() ||
                   !sector.commands.empty() || now_ >= sector.wake;
  if (!due) return;
  AgentEffects agent;
  sector.agent->Step({.now = now,
                      .orders = sector.orders,
                      .news = sector.news,
                      .kept = sector.kept,
                      .view = sector.coordinator->sector(),
                      .configuration = &sector.coordinator->configuration(),
                      .job = sector.last.plan_job ? &*sector.last.plan_job : nullptr,
                      .exposure = sector.last.exposure ? &*sector.last.exposure : nullptr,
                      .drives = sector.coordinator->drives(),
                      .places = PlacesOf(sector),
                      .replies = sector.last.replies,
                      .ends = sector.last.border_ends},
                     &agent);
  sector.orders.clear();
  sector.news.clear();
  for (const Command& command : agent.commands)
    if (commanded) commanded(which, *sector.agent, command);
  if (agent.keep && (!sector.keep || *sector.keep < *agent.keep)) {
    sector.keep = agent.keep;
    sector.keep_at = now_ + options_.commit_delay;
  }
  sector.notes.insert(sector.notes.end(), agent.notes.begin(), agent.notes.end());
  if (agent.report)
    for (std::uint32_t n = 0; n < planes.size(); ++n)
      network.Send(which, Node(n), *agent.report, now_);
  if (agent.news)
    for (std::uint32_t n = 0; n < sectors.size(); ++n)
      if (n != which) network.Send(which, n, *agent.news, now_);
  for (Command& command : sector.commands) agent.commands.push_back(std::move(command));
  sector.commands.clear();
  std::vector<LinkEvent> links;
  for (std::size_t n = 0; n < sector.controllers.size(); ++n)
    if (sector.controllers[n].Look(*world_))
      links.push_back({sector.layout->buses()[n], sector.controllers[n].state(),
                       sector.controllers[n].trouble()});
  sector.last.Clear();
  sector.coordinator->Step({.now = now,
                            .frames = sector.frames,
                            .links = links,
                            .commands = agent.commands,
                            .plans = {},
                            .notes = agent.notes,
                            .committed_through = sector.storage.committed_through()},
                           &sector.last);
  sector.frames.clear();
  sector.storage.Put(now_, sector.last);
  for (const OutFrame& out : sector.last.frames) world_->Inject(out.bus, out.frame, now_);
  const Effects& last = sector.last;
  const bool again = !agent.commands.empty() || last.plan_job || last.exposure ||
                     !last.replies.empty() || !last.border_ends.empty();
  const HostInstant wake = std::min(last.wake_at, agent.wake_at);
  sector.wake = again ? now_ : wake == kNever ? kNever : now_ + (wake - now);
}

void PlaneInProcess::TurnPlane(std::uint32_t which) {
  Plane& at = planes[which];
  const HostInstant now = now_ + at.ahead;
  bool due = !at.reports.empty() || !at.commands.empty() || now_ >= at.wake;
  if (at.keep && now_ >= at.keep_at) {
    at.kept = *std::exchange(at.keep, {});
    at.kept_number = at.keep_number;
    due = true;
  }
  std::vector<PlanePlanDone> plans;
  if (at.job && now_ >= at.job_due) {
    plans.push_back(RunPlaneJob(*std::exchange(at.job, {}), *layout_));
    if (at.plan_fault) at.plan_fault(&plans.back());
    due = true;
  }
  const auto exposures = at.camera.TakeDue(now_, layout_->layout(), drives_, *world_);
  due = due || !exposures.empty();
  if (!due) return;
  PlaneEffects effects;
  at.coordinator->Step({.now = now,
                        .reports = at.reports,
                        .commands = at.commands,
                        .plans = plans,
                        .exposures = exposures,
                        .kept = at.kept_number},
                       &effects);
  at.reports.clear();
  at.commands.clear();
  for (const PlaneOrder& order : effects.orders)
    network.Send(Node(which), order.sector, order, now_);
  if (effects.job) {
    at.job = std::move(effects.job);
    at.job_due = now_ + options_.plan_delay;
  }
  if (effects.exposure) at.camera.Put(now_, effects.exposure->job);
  if (effects.record) {
    at.keep = std::move(effects.record);
    at.keep_number = effects.record_number;
    at.keep_at = now_ + options_.commit_delay;
  }
  at.replies.insert(at.replies.end(), effects.replies.begin(), effects.replies.end());
  at.log.insert(at.log.end(), effects.log.begin(), effects.log.end());
  at.notes.insert(at.notes.end(), effects.notes.begin(), effects.notes.end());
  at.wake = effects.wake_at == kNever ? kNever : now_ + (effects.wake_at - now);
}

void PlaneInProcess::Deliver() {
  for (PlaneNetwork::Delivery& delivery : network.TakeDue(now_)) {
    if (delivery.to >= sectors.size()) {
      Plane& at = planes[delivery.to - sectors.size()];
      if (at.coordinator != nullptr)
        at.reports.push_back(std::get<SectorReport>(std::move(delivery.message)));
      continue;
    }
    Sector& sector = sectors[delivery.to];
    if (sector.coordinator == nullptr) continue;
    if (auto* order = std::get_if<PlaneOrder>(&delivery.message))
      sector.orders.push_back(std::move(*order));
    else
      sector.news.push_back(std::get<BorderNews>(std::move(delivery.message)));
  }
}

void PlaneInProcess::Turn() {
  std::vector<ReceivedFrame> frames;
  world_->AdvanceTo(now_, &frames);
  for (ReceivedFrame& frame : frames) {
    Sector& sector = sectors[frame.bus.value];  // a bus a sector
    if (sector.coordinator == nullptr) continue;
    frame.at = OfSector(sector, frame.at);
    sector.frames.push_back(frame);
  }
  Deliver();
  for (std::uint32_t n = 0; n < sectors.size(); ++n)
    if (sectors[n].coordinator != nullptr) TurnSector(n);
  for (std::uint32_t n = 0; n < planes.size(); ++n)
    if (planes[n].coordinator != nullptr) TurnPlane(n);
}

HostInstant PlaneInProcess::Next() const {
  HostInstant next = std::min(world_->NextEvent(), network.due());
  if (now_ < look_at) next = std::min(next, look_at);
  for (const Sector& sector : sectors) {
    if (sector.coordinator == nullptr) continue;
    next = std::min({next, sector.wake, sector.storage.due()});
    if (sector.keep) next = std::min(next, sector.keep_at);
    if (!sector.commands.empty()) next = now_;
  }
  for (const Plane& at : planes) {
    if (at.coordinator == nullptr) continue;
    next = std::min(next, at.wake);
    if (at.keep) next = std::min(next, at.keep_at);
    if (at.job) next = std::min(next, at.job_due);
    next = std::min(next, at.camera.due());
    if (!at.commands.empty()) next = now_;
  }
  return next;
}

bool PlaneInProcess::RunUntil(const std::function<bool()>& done, DurationNs limit) {
  const HostInstant end = now_ + limit;
  for (;;) {
    Turn();
    if (looked) looked();
    if (done()) return true;
    const HostInstant next = std::max(Next(), now_ + kTurn);
    if (next > end) {
      now_ = end;
      Turn();
      return done();
    }
    now_ = next;
  }
}

void PlaneInProcess::Run(DurationNs duration) {
  RunUntil([] { return false; }, duration);
}

}  // namespace focalfleet::test
