// This bench measures the CPU time of the host's side of one configuration, without units and
// planner. The host's side is the coordinator, codec and transmit queues of all buses, from the
// plan to the last unit's arrival. All runs on virtual time, against the simulated fleet in the
// same process. The host's calls alone are between the two readings of the thread's clock. The cost
// of the readings themselves stands in the last column and is in the figures. Beside each size a
// loop of known work shows how busy the machine was.
//   configure_bench [--units 0] [--runs 5] [--per-bus 100]    0: 500, 1000, 2000 and 5000 units
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/loop/transmit_queue.h"
#include "fleet/coordinator.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/plan/job.h"
#include "fleet/targets.h"
#include "sim/world/world.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;

// Between two steps at least this much time passes, as between two turns of the daemon's loop.
constexpr DurationNs kTurn = Microseconds(200);
constexpr HostInstant kBegin{1'000'000'000};

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double ReadingSeconds() {
  constexpr int kReadings = 20'000;
  const double begin = CpuSeconds();
  for (int i = 0; i < kReadings; ++i) static_cast<void>(CpuSeconds());
  return (CpuSeconds() - begin) / kReadings;
}

/// The time of 100 million steps of a generator that no compiler shortens.
double KnownWorkSeconds() {
  const double begin = CpuSeconds();
  std::uint64_t state = 1;
  for (int i = 0; i < 100'000'000; ++i) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
  }
  const double taken = CpuSeconds() - begin;
  return state == 0 ? 0 : taken;
}

sim::UnitDescription Describe(const Unit& unit, const Pose& pose) {
  sim::UnitDescription described{.id = unit.id,
                                 .bus = unit.bus,
                                 .node = unit.node,
                                 .base_x_mm = unit.base_fp.x_mm,
                                 .base_y_mm = unit.base_fp.y_mm};
  for (const Axis axis : kAxes) {
    const AxisGeometry& g = unit.axis[Index(axis)];
    described.axis[Index(axis)] = {g.arm_mm,  g.zero_deg, g.gear,
                                   g.min_deg, g.max_deg,  AngleDeg(pose[Index(axis)], g, {})};
  }
  return described;
}

struct Taking : FramePort {
  std::size_t Send(std::span<const CanFrame> frames) override {
    taken.insert(taken.end(), frames.begin(), frames.end());
    return frames.size();
  }
  void Receive(HostInstant, std::vector<ReceivedFrame>*) override {}
  [[nodiscard]] LinkState state() const override { return LinkState::kUp; }
  std::vector<CanFrame> taken;
};

struct Figures {
  double upload_s = 0;  // from the plan to the start signal, host's CPU
  double whole_s = 0;   // from the plan to the last arrival
  std::uint64_t upload_frames = 0;
  std::uint64_t frames = 0;
  std::uint64_t steps = 0;
  std::uint32_t arrived = 0;
};

class Run {
 public:
  Run(std::uint32_t count, std::uint32_t per_bus)
      : layout_(
            Layout::Create(MakeHexLayout({.count = count, .units_per_bus = per_bus}), {}).value()),
        drives_(count),
        ports_(layout_.buses().size()),
        transmit_queues_(layout_.buses().size()) {
    const auto start = Draw("start");
    sim::WorldConfig config;
    for (std::uint32_t n = 0; n < count; ++n)
      config.units.push_back(Describe(layout_.units()[n], *start[n]));
    config.start = now_;
    world_ = std::make_unique<sim::World>(std::move(config));
    coordinator_ =
        std::make_unique<Coordinator>(&layout_, drives_, CoordinatorConfig{}, StoredFleet{});
  }

  Figures Go() {
    while (now_ < kBegin + Seconds(5)) Turn();  // all units have been read
    commands_.push_back({1, ApplyCommand{"bench", Draw("targets"), false}});
    do Turn();
    while (coordinator_->configuration().state == ConfigurationState::kPlanning);
    figures_ = {};
    counting_ = true;
    const std::uint64_t before = coordinator_->configuration().frames;
    while (coordinator_->configuration().state == ConfigurationState::kUploading) Turn();
    figures_.upload_s = figures_.whole_s;
    figures_.upload_frames = coordinator_->configuration().frames - before;
    while (coordinator_->busy()) Turn();
    figures_.frames = coordinator_->configuration().frames - before;
    figures_.arrived = coordinator_->configuration().counts.arrived;
    return figures_;
  }

 private:
  std::vector<std::optional<Pose>> Draw(const char* purpose) {
    const auto poses = DrawConfiguration(layout_, drives_, {}, Rng::Stream(1, purpose));
    return {poses->begin(), poses->end()};
  }

  void Turn() {
    world_->AdvanceTo(now_, &heard_);
    std::vector<PlanDone> plans;
    if (job_) plans.push_back(RunPlanJob(*job_, layout_, drives_));
    job_.reset();
    const double begin = CpuSeconds();
    effects_.Clear();
    coordinator_->Step({.now = now_,
                        .frames = heard_,
                        .links = {},
                        .commands = commands_,
                        .plans = plans,
                        .committed_through = committed_},
                       &effects_);
    for (const OutFrame& out : effects_.frames)
      transmit_queues_[out.bus.value].Put(out.frame, now_);
    for (std::size_t bus = 0; bus < transmit_queues_.size(); ++bus)
      if (transmit_queues_[bus].size() > 0) transmit_queues_[bus].Flush(&ports_[bus], now_);
    const double taken = CpuSeconds() - begin;
    if (counting_) {
      figures_.whole_s += taken;
      ++figures_.steps;
    }
    heard_.clear();
    commands_.clear();
    if (effects_.batch != 0) committed_ = effects_.batch;
    job_ = std::move(effects_.plan_job);
    for (std::uint32_t bus = 0; bus < ports_.size(); ++bus) {
      for (const CanFrame& frame : ports_[bus].taken) world_->Inject({bus}, frame, now_);
      ports_[bus].taken.clear();
    }
    const bool soon = job_.has_value() || effects_.batch != 0;
    const HostInstant next = soon ? now_ : std::min(effects_.wake_at, world_->NextEvent());
    now_ = std::max(next, now_ + kTurn);
  }

  Layout layout_;
  std::vector<UnitDrive> drives_;
  std::vector<Taking> ports_;  // by bus, which are numbered from 0
  std::vector<TransmitQueue> transmit_queues_;
  std::unique_ptr<sim::World> world_;
  std::unique_ptr<Coordinator> coordinator_;
  HostInstant now_ = kBegin;
  std::vector<ReceivedFrame> heard_;
  std::vector<Command> commands_;
  std::optional<PlanJob> job_;
  Effects effects_;
  std::uint64_t committed_ = 0;
  bool counting_ = false;
  Figures figures_;
};

/// Measures the median of several runs; false where a unit did not arrive.
bool Measure(std::uint32_t count, std::uint32_t per_bus, int runs) {
  std::vector<double> upload;
  std::vector<double> whole;
  std::vector<double> known;
  Figures figures;
  for (int run = 0; run < runs; ++run) {
    known.push_back(KnownWorkSeconds());
    figures = Run(count, per_bus).Go();
    upload.push_back(figures.upload_s);
    whole.push_back(figures.whole_s);
  }
  std::printf("%6u %9.4f %9llu %8.2f %9.4f %9llu %9llu %8.2f %9.4f %9.4f\n", count, Median(upload),
              static_cast<unsigned long long>(figures.upload_frames), 1e6 * Median(upload) / count,
              Median(whole), static_cast<unsigned long long>(figures.frames),
              static_cast<unsigned long long>(figures.steps), 1e6 * Median(whole) / count,
              Median(known), 2 * ReadingSeconds() * static_cast<double>(figures.steps));
  std::fflush(stdout);
  return figures.arrived == count;
}

int Main(int argc, char** argv) {
  const int units = Option(argc, argv, "--units", 0);
  const int runs = Option(argc, argv, "--runs", 5);
  const auto per_bus = static_cast<std::uint32_t>(Option(argc, argv, "--per-bus", 100));
  std::printf("host's CPU seconds, median of %d runs\n", runs);
  std::printf("%6s %9s %9s %8s %9s %9s %9s %8s %9s %9s\n", "units", "upload", "frames", "us/unit",
              "whole", "frames", "steps", "us/unit", "known", "readings");
  const std::vector<int> sizes =
      units == 0 ? std::vector<int>{500, 1000, 2000, 5000} : std::vector<int>{units};
  bool good = true;
  for (const int count : sizes)
    good = Measure(static_cast<std::uint32_t>(count), per_bus, runs) && good;
  return good ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
