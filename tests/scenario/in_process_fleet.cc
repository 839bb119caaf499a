#include "tests/scenario/in_process_fleet.h"

#include <algorithm>

#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"

namespace focalfleet::test {
namespace {

// Between two steps at least this much time passes, as between two turns of the daemon's loop.
constexpr DurationNs kTurn = Microseconds(200);

sim::UnitDescription Describe(const Unit& unit, const Pose& pose, const UnitDrive& drive) {
  sim::UnitDescription described{.id = unit.id,
                                 .bus = unit.bus,
                                 .node = unit.node,
                                 .serial = {},
                                 .base_x_mm = unit.base_fp.x_mm,
                                 .base_y_mm = unit.base_fp.y_mm,
                                 .axis = {},
                                 .sensors = unit.sensors,
                                 .fibre_carrier_mm = unit.carrier_mm,
                                 .enabled = unit.enabled};
  for (const Axis axis : kAxes) {
    const AxisGeometry& g = unit.axis[Index(axis)];
    described.axis[Index(axis)] = {
        g.arm_mm,  g.zero_deg, g.gear,
        g.min_deg, g.max_deg,  AngleDeg(pose[Index(axis)], g, drive.axis[Index(axis)])};
  }
  return described;
}

}  // namespace

InProcessFleet::InProcessFleet(const Options& options)
    : storage(options.commit_delay),
      planner(options.plan_delay),
      camera({options.exposure_delay, options.centroid_sigma_um}),
      options_(options) {
  std::vector<focalfleet::Unit> units = MakeHexLayout(
      {.count = options.count, .units_per_bus = options.units_per_bus, .sensors = options.sensors});
  for (focalfleet::Unit& unit : units) unit.id.value += options.first_id - 1;
  auto layout = Layout::Create(std::move(units), {});
  FOCALFLEET_CHECK(layout.has_value());
  layout_ = std::make_unique<Layout>(std::move(*layout));
  drives_.assign(layout_->size(), UnitDrive{});
  const auto start = DrawConfiguration(*layout_, drives_, {}, Rng::Stream(options.seed, "start"));
  FOCALFLEET_CHECK(start.has_value());
  sim::WorldConfig config{.units = {},
                          .seed = options.seed,
                          .spread = options.spread,
                          .drive = options.factory,
                          .faults = options.faults};
  for (std::uint32_t n = 0; n < layout_->size(); ++n)
    config.units.push_back(Describe(layout_->units()[n], (*start)[n], drives_[n]));
  for (const auto& [n, error] : options.clock_errors) config.units[n].clock_error = error;
  config.joint_sensors = MakeJoints(*layout_, options.seed, options.spread);
  config.start = now_;
  config.clock_error_max = options.clock_error_max;
  FOCALFLEET_CHECK(sim::World::Validate(config).has_value());
  world_ = std::make_unique<sim::World>(std::move(config));
  for (const BusId bus : layout_->buses()) controllers_.emplace_back(bus);
  Restart();
}

void InProcessFleet::Restart() {
  storage.Restart();
  planner.Restart();
  camera.Restart();
  inputs_.commands.clear();
  coordinator_ =
      std::make_unique<Coordinator>(layout_.get(), drives_, options_.config, store().fleet);
  wake_at_ = now_;
}

void InProcessFleet::End() {
  Effects last;
  coordinator_->End(now_, &last);
  storage.CommitAll(last);
}

void InProcessFleet::StepOnce() {
  world_->AdvanceTo(now_, &inputs_.frames, wire);
  if (now_ >= sync_at_) {
    world_->PulseSync();
    sync_at_ = kNever;
  }
  for (std::size_t i = 0; i < controllers_.size(); ++i)
    if (controllers_[i].Look(*world_))
      inputs_.links.push_back(
          {layout_->buses()[i], controllers_[i].state(), controllers_[i].trouble()});
  const auto plans = planner.TakeDue(now_, *layout_, coordinator_->drives());
  const auto exposures = camera.TakeDue(now_, *layout_, drives_, *world_);
  storage.CommitDue(now_);
  if (options_.stamped_when_heard)
    for (ReceivedFrame& frame : inputs_.frames) frame.at = std::max(frame.at, now_);
  const std::vector<RefusedRow> refused = storage.TakeRefused();
  effects_.Clear();
  coordinator_->Step({.now = now_,
                      .frames = inputs_.frames,
                      .links = inputs_.links,
                      .commands = inputs_.commands,
                      .plans = plans,
                      .exposures = exposures,
                      .committed_through = storage.committed_through(),
                      .store_failing = storage.fails,
                      .refused = refused},
                     &effects_);
  inputs_.frames.clear();
  inputs_.commands.clear();
  inputs_.links.clear();
  Perform(effects_);
}

void InProcessFleet::Perform(const Effects& effects) {
  if (held_up) Freeze(held_up(), Heard::kWaits);
  if (sent != nullptr) sent->insert(sent->end(), effects.frames.begin(), effects.frames.end());
  storage.Put(now_, effects);
  if (effects.sync_at) sync_at_ = *effects.sync_at;
  for (const OutFrame& out : effects.frames) {
    world_->Inject(out.bus, out.frame, now_);
    for (const std::uint64_t word : {std::uint64_t{out.bus.value}, std::uint64_t{out.frame.id},
                                     static_cast<std::uint64_t>(now_.ns)})
      digest_ = (digest_ ^ word) * 0x100000001b3u;
    for (const std::uint8_t byte : out.frame.payload()) digest_ = (digest_ ^ byte) * 0x100000001b3u;
  }
  if (effects.plan_job) planner.Put(now_, *effects.plan_job);
  if (effects.exposure) camera.Put(now_, *effects.exposure);
  replies_.insert(replies_.end(), effects.replies.begin(), effects.replies.end());
  wake_at_ = effects.wake_at;
}

bool InProcessFleet::RunUntil(const std::function<bool()>& done, DurationNs limit) {
  const HostInstant end = now_ + limit;
  for (;;) {
    StepOnce();
    if (done()) return true;
    HostInstant next = std::min(wake_at_, world_->NextEvent());
    next = std::min({next, storage.due(), camera.due(), planner.due(), sync_at_});
    if (!inputs_.commands.empty() || !inputs_.links.empty()) next = now_;
    next = std::max(next, now_ + kTurn);
    if (next > end) {
      now_ = end;
      StepOnce();
      return done();
    }
    now_ = next;
  }
}

void InProcessFleet::Run(DurationNs duration) {
  RunUntil([] { return false; }, duration);
}

bool InProcessFleet::RunUntilIdle(DurationNs limit) {
  return RunUntil([&] { return inputs_.commands.empty() && !coordinator_->busy(); }, limit);
}

void InProcessFleet::Freeze(DurationNs duration, Heard heard) {
  now_ = now_ + duration;
  world_->AdvanceTo(now_, &inputs_.frames, wire);
  if (heard == Heard::kLost) inputs_.frames.clear();
}

void InProcessFleet::Send(Command command) { inputs_.commands.push_back(std::move(command)); }

std::uint64_t InProcessFleet::Apply(std::vector<std::optional<Pose>> targets) {
  const std::uint64_t request = next_request_++;
  Send({request, ApplyCommand{"test", std::move(targets), false}});
  return request;
}

std::uint64_t InProcessFleet::ApplyRandom(std::uint64_t seed) {
  std::vector<std::optional<Pose>> standing(layout_->size());
  const auto poses = DrawConfiguration(*layout_, drives_, standing, Rng::Stream(seed, "targets"));
  FOCALFLEET_CHECK(poses.has_value());
  return Apply({poses->begin(), poses->end()});
}

std::uint64_t InProcessFleet::ApplyRandomMeasured(std::uint64_t seed,
                                                  const ApplyCommand::Measure& measure) {
  std::vector<std::optional<Pose>> standing(layout_->size());
  const auto poses = DrawConfiguration(*layout_, drives_, standing, Rng::Stream(seed, "targets"));
  FOCALFLEET_CHECK(poses.has_value());
  return ApplyMeasured({poses->begin(), poses->end()}, measure);
}

std::uint64_t InProcessFleet::ApplyMeasured(std::vector<std::optional<Pose>> targets,
                                            const ApplyCommand::Measure& measure) {
  const std::uint64_t request = next_request_++;
  Send({request, ApplyCommand{.source = "measured",
                              .targets = std::move(targets),
                              .fixed = false,
                              .measure = measure}});
  return request;
}

std::optional<ReplyEffect> InProcessFleet::LastReply(std::uint64_t request) const {
  for (auto it = replies_.rbegin(); it != replies_.rend(); ++it)
    if (it->request == request) return *it;
  return std::nullopt;
}

}  // namespace focalfleet::test
