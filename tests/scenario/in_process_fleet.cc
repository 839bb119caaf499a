#include "tests/scenario/in_process_fleet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fleet/camera/findings.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/plan/job.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"
#include "protocol/wire/codec.h"

namespace focalfleet::test {
namespace {

// Between two steps at least this much time passes, as between two turns of the daemon's loop.
constexpr DurationNs kTurn = Microseconds(200);

// At rest the rotor lags the field by the angle whose sine is load over stall torque, 15 degrees of
// 360 at 1.8 V. The lag is 4 of 96 vectors. The remaining 2 are for rounding and for the motor's
// own spread. The interval, not this margin, contains the effect of a cut motion. No run of these
// scenarios exceeds 5.
constexpr double kLagVectorsMax = 6;

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

InProcessFleet::InProcessFleet(const Options& options) : options_(options) {
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
  commits_.clear();  // rows that were not durable are lost
  refused_.clear();
  planning_.clear();
  exposing_.clear();
  commands_.clear();
  committed_through_ = 0;
  coordinator_ =
      std::make_unique<Coordinator>(layout_.get(), drives_, options_.config, store_.fleet);
  wake_at_ = now_;
}

void InProcessFleet::End() {
  Effects last;
  coordinator_->End(now_, &last);
  for (const Commit& commit : commits_) store_.CommitAllBut(commit.batch, commit.rows);
  store_.CommitAllBut(last.batch, last.rows);
}

void InProcessFleet::StepOnce() {
  world_->AdvanceTo(now_, &heard_, wire);
  if (now_ >= sync_at_) {
    world_->PulseSync();
    sync_at_ = kNever;
  }
  for (std::size_t i = 0; i < controllers_.size(); ++i)
    if (controllers_[i].Look(*world_))
      links_.push_back({layout_->buses()[i], controllers_[i].state(), controllers_[i].trouble()});
  std::vector<PlanDone> plans;
  while (!planning_.empty() && planning_.front().at <= now_) {
    plans.push_back(RunPlanJob(planning_.front().job, *layout_, coordinator_->drives()));
    planning_.pop_front();
    if (plans.back().plan) last_plan_ = *plans.back().plan;
  }
  std::vector<ExposureDone> exposures;
  while (!exposing_.empty() && exposing_.front().at <= now_) {
    exposures.push_back(Expose(exposing_.front().job));
    if (camera_fault) camera_fault(&exposures.back());
    exposing_.pop_front();
  }
  while (!store_fails && !commits_.empty() && commits_.front().at <= now_) {
    Commit& next = commits_.front();
    for (std::size_t k = next.rows.size(); refuse && k-- > 0;) {
      if (!refuse(next.rows[k])) continue;
      refused_.push_back({next.batch, next.batch, next.rows[k], "the test refuses it"});
      next.rows.erase(next.rows.begin() + static_cast<std::ptrdiff_t>(k));
    }
    for (RefusedRow& row : store_.CommitAllBut(next.batch, next.rows))
      refused_.push_back(std::move(row));
    committed_through_ = commits_.front().batch;
    commits_.pop_front();
  }
  if (options_.stamped_when_heard)
    for (ReceivedFrame& frame : heard_) frame.at = std::max(frame.at, now_);
  effects_.Clear();
  coordinator_->Step({.now = now_,
                      .frames = heard_,
                      .links = links_,
                      .commands = commands_,
                      .plans = plans,
                      .exposures = exposures,
                      .committed_through = committed_through_,
                      .store_failing = store_fails,
                      .refused = refused_},
                     &effects_);
  refused_.clear();
  heard_.clear();
  commands_.clear();
  links_.clear();
  Perform(effects_);
}

void InProcessFleet::Perform(const Effects& effects) {
  if (held_up) Freeze(held_up(), Heard::kWaits);
  if (sent != nullptr) sent->insert(sent->end(), effects.frames.begin(), effects.frames.end());
  if (!effects.rows.empty())
    commits_.push_back({now_ + options_.commit_delay, effects.batch, effects.rows});
  if (effects.sync_at) sync_at_ = *effects.sync_at;
  for (const OutFrame& out : effects.frames) {
    world_->Inject(out.bus, out.frame, now_);
    for (const std::uint64_t word : {std::uint64_t{out.bus.value}, std::uint64_t{out.frame.id},
                                     static_cast<std::uint64_t>(now_.ns)})
      digest_ = (digest_ ^ word) * 0x100000001b3u;
    for (const std::uint8_t byte : out.frame.payload()) digest_ = (digest_ ^ byte) * 0x100000001b3u;
  }
  if (effects.plan_job) planning_.push_back({now_ + options_.plan_delay, *effects.plan_job});
  if (effects.exposure) exposing_.push_back({now_ + options_.exposure_delay, *effects.exposure});
  replies_.insert(replies_.end(), effects.replies.begin(), effects.replies.end());
  wake_at_ = effects.wake_at;
}

// A camera that sees every fibre and knows its unit: detection and identification have tests of
// their own.
ExposureDone InProcessFleet::Expose(const ExposureJob& job) {
  if (measurer) return measurer(job);
  const std::vector<UnitExpectation> expected = Expect(*layout_, {.now = job.expected,
                                                                  .before = job.before,
                                                                  .seen = job.seen,
                                                                  .reported = job.reported,
                                                                  .drives = drives_});
  ExposureFindings exposure{
      .id = job.id, .measurements = {}, .after_request_s = options_.exposure_delay.seconds()};
  for (std::uint32_t n = 0; n < layout_->size(); ++n) {
    const sim::UnitTruth truth = world_->Truth(n);
    const double noise_mm = 1e-3 * options_.centroid_sigma_um;
    Measurement measurement{.unit = {n},
                            .status = MeasurementStatus::kMeasured,
                            .other = {},
                            .x_mm = truth.x_mm + noise_mm * camera_noise_.Normal(),
                            .y_mm = truth.y_mm + noise_mm * camera_noise_.Normal(),
                            .covariance = RoundCovariance(options_.centroid_sigma_um),
                            .place = {}};
    const PointFp seen{measurement.x_mm, measurement.y_mm};
    if (IsPlace(job.expected[n]))
      measurement.place =
          PlaceSeen(layout_->units()[n], drives_[n], seen, PlaceOf(job.expected[n]));
    else
      measurement.place = PoseOfLost(layout_->units()[n], drives_[n], seen, expected[n],
                                     options_.centroid_sigma_um * 1e-3);
    exposure.measurements.push_back(measurement);
  }
  return {job.id, std::move(exposure)};
}

bool InProcessFleet::RunUntil(const std::function<bool()>& done, DurationNs limit) {
  const HostInstant end = now_ + limit;
  for (;;) {
    StepOnce();
    if (done()) return true;
    HostInstant next = std::min(wake_at_, world_->NextEvent());
    if (!commits_.empty() && !store_fails) next = std::min(next, commits_.front().at);
    if (!exposing_.empty()) next = std::min(next, exposing_.front().at);
    if (!planning_.empty()) next = std::min(next, planning_.front().at);
    next = std::min(next, sync_at_);
    if (!commands_.empty() || !links_.empty()) next = now_;
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
  return RunUntil([&] { return commands_.empty() && !coordinator_->busy(); }, limit);
}

void InProcessFleet::Freeze(DurationNs duration, Heard heard) {
  now_ = now_ + duration;
  world_->AdvanceTo(now_, &heard_, wire);
  if (heard == Heard::kLost) heard_.clear();
}

void InProcessFleet::StopDirectly() {
  constexpr std::uint8_t kOtherHostsSequence = 255;
  for (const BusId bus : layout_->buses())
    world_->Inject(bus, Encode(HostMessage(Stop{}), {kBroadcastNode, kOtherHostsSequence}), now_,
                   1);
}

void InProcessFleet::Send(Command command) { commands_.push_back(std::move(command)); }

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

std::uint32_t InProcessFleet::CountOutcome(TargetOutcome outcome) const {
  std::uint32_t count = 0;
  for (std::uint32_t n = 0; n < layout_->size(); ++n)
    if (coordinator_->unit({n}).outcome == outcome) ++count;
  return count;
}

std::vector<Pose> InProcessFleet::TruePoses() const {
  std::vector<Pose> poses;
  for (std::size_t n = 0; n < layout_->size(); ++n) {
    const sim::UnitTruth truth = world_->Truth(n);
    poses.push_back({static_cast<std::int32_t>(std::lround(truth.vectors[0])),
                     static_cast<std::int32_t>(std::lround(truth.vectors[1]))});
  }
  return poses;
}

void InProcessFleet::ExpectStoreTellsTheTruth(const std::string& when) const {
  for (std::size_t n = 0; n < layout_->size(); ++n) {
    const UnitView& view = coordinator_->unit({static_cast<std::uint32_t>(n)});
    const VectorRow* row = store_.Vector(view.serial);
    const sim::UnitTruth truth = world_->Truth(n);
    EXPECT_EQ(truth.begun_twice, 0u) << when << ": unit " << truth.id.value;
    ASSERT_NE(row, nullptr) << when << ": unit " << truth.id.value;
    for (const Axis axis : kAxes) {
      const AxisKnowledge& known = row->knowledge[Index(axis)];
      if (known.witness == Witness::kUnknown) continue;
      EXPECT_GE(truth.vectors[Index(axis)], known.low - kLagVectorsMax)
          << when << ": unit " << truth.id.value << " " << Name(axis) << " " << Name(known.witness);
      EXPECT_LE(truth.vectors[Index(axis)], known.high + kLagVectorsMax)
          << when << ": unit " << truth.id.value << " " << Name(axis) << " " << Name(known.witness);
    }
  }
}

}  // namespace focalfleet::test
