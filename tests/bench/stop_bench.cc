// This bench measures a stop of all on buses at their limit. The time runs from the command to the
// end of arbitration of the last bus' stop frame, in frame times of the simulated bit clock. The
// real coordinator uploads to every unit through the daemon's transmit queues and simulated ports.
// A second host polls so that no bit is left, and units answer everything several times over. The
// stop is one broadcast a bus; later frames (loaded units are asked to disarm) end no motion.
// The exit code is 1 where a stop took more than two frame times, or a bus was not saturated. Time
// is simulated, so the result does not depend on the machine.
//   stop_bench [--buses 50] [--units-per-bus 100] [--stops 200] [--seed 1]
#include <algorithm>
#include <cstdio>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/loop/transmit_queue.h"
#include "daemon/ports/simulated_port.h"
#include "fleet/hex_layout.h"
#include "fleet/plan/job.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

using bench::Option;

constexpr DurationNs kTurn = Microseconds(200);  // of the daemon's loop
constexpr DurationNs kBit = Microseconds(1);
/// The shortest frame of eight bytes: the strictest measure.
constexpr double kFrameTimeBits = 131;
constexpr std::uint8_t kAnswerCopies = 3;
constexpr std::size_t kPollsWaiting = 12;

struct StopTaken {
  double worst_bits = 0;  // over the buses
  double median_bits = 0;
  double load_min = 1;  // of the least busy bus during the upload
};

class StopBench {
 public:
  StopBench(int buses, int units_per_bus, std::uint64_t seed)
      : rng_(seed),
        layout_(Layout::Create(
                    MakeHexLayout({.count = static_cast<std::uint32_t>(buses * units_per_bus),
                                   .units_per_bus = static_cast<std::uint32_t>(units_per_bus)}),
                    {})
                    .value()),
        drives_(layout_.size()) {
    sim::WorldConfig config{.units = DescribeUnits(layout_), .seed = seed, .start = now_};
    const auto start = DrawConfiguration(layout_, drives_, {}, Rng::Stream(seed, "start")).value();
    for (std::size_t n = 0; n < layout_.size(); ++n)
      for (const Axis axis : kAxes)
        config.units[n].axis[Index(axis)].angle_deg =
            AngleDeg(start[n][Index(axis)], layout_.units()[n].axis[Index(axis)],
                     drives_[n].axis[Index(axis)]);
    fleet_ = SimulatedFleet::Create(std::move(config)).value();
    coordinator_ =
        std::make_unique<Coordinator>(&layout_, drives_, CoordinatorConfig{}, StoredFleet{});
    for (const BusId bus : layout_.buses())
      lines_.push_back({bus, std::make_unique<SimulatedPort>(fleet_, bus), TransmitQueue()});
    while (!AllReady()) Turn();
    for (const Unit& unit : layout_.units())
      fleet_->world().disturb().faults(unit.id)->copies = kAnswerCopies;
    std::vector<std::optional<Pose>> standing(layout_.size());
    const auto targets =
        DrawConfiguration(layout_, drives_, standing, Rng::Stream(seed, "targets")).value();
    targets_.assign(targets.begin(), targets.end());
  }

  StopTaken Measure(DurationNs into_upload) {
    commands_.push_back({++requests_, ApplyCommand{"bench", targets_, false}});
    saturating_ = true;
    while (coordinator_->configuration().state != ConfigurationState::kUploading) Turn();
    for (const HostInstant end = now_ + Milliseconds(2); now_ < end;) Turn();
    const std::vector<sim::BusCounters> before = Counters();
    const HostInstant from = now_;
    const HostInstant at = now_ + into_upload;
    while (now_ + kTurn < at) Turn();
    now_ = at;
    FOCALFLEET_CHECK(coordinator_->configuration().state == ConfigurationState::kUploading);
    commands_.push_back({++requests_, StopCommand{}});
    wire_.clear();
    Step();
    StopTaken stop = Loads(before, at - from);
    fleet_->world().AdvanceTo(at + Milliseconds(2), &heard_, &wire_);
    now_ = at + Milliseconds(2);
    Waits(at, &stop);
    saturating_ = false;
    while (coordinator_->busy() || !AllReady()) Turn();
    return stop;
  }

 private:
  struct Line {
    BusId bus;
    std::unique_ptr<SimulatedPort> port;
    TransmitQueue transmit_queue;
  };

  [[nodiscard]] bool AllReady() const {
    for (std::uint32_t n = 0; n < layout_.size(); ++n)
      if (coordinator_->unit({n}).phase != UnitPhase::kReady) return false;
    return true;
  }
  [[nodiscard]] std::vector<sim::BusCounters> Counters() const {
    std::vector<sim::BusCounters> all;
    for (const BusId bus : layout_.buses()) all.push_back(fleet_->world().counters(bus));
    return all;
  }

  StopTaken Loads(const std::vector<sim::BusCounters>& before, DurationNs passed) const {
    StopTaken stop;
    const std::vector<sim::BusCounters> after = Counters();
    for (std::size_t i = 0; i < after.size(); ++i)
      stop.load_min =
          std::min(stop.load_min,
                   sim::WireUse{.busy = after[i].wire.busy - before[i].wire.busy}.Load(passed));
    return stop;
  }
  void Waits(HostInstant at, StopTaken* stop) const {
    std::vector<double> waits;
    for (const sim::WireFrame& carried : wire_) {
      const auto decoded = DecodeHost(carried.frame);
      if (carried.from_unit || carried.at < at || !decoded ||
          !std::holds_alternative<Stop>(decoded->message) ||
          decoded->address.node != kBroadcastNode)
        continue;
      const std::uint32_t behind = FrameBits(carried.frame) - LevelsOf(carried.frame).arbitration;
      waits.push_back(static_cast<double>((carried.at - at).ns - behind * kBit.ns) / 1000);
    }
    FOCALFLEET_CHECK(waits.size() == lines_.size());
    stop->worst_bits = *std::ranges::max_element(waits);
    stop->median_bits = bench::Median(waits);
  }

  void Turn() {
    fleet_->world().AdvanceTo(now_, &heard_);
    Step();
    now_ = now_ + kTurn;
  }
  void Step() {
    fleet_->world().AdvanceTo(now_, &heard_);
    std::vector<PlanDone> plans;
    if (job_) plans.push_back(PlanOf(*job_));
    job_.reset();
    effects_.Clear();
    coordinator_->Step({.now = now_,
                        .frames = heard_,
                        .links = {},
                        .commands = commands_,
                        .plans = plans,
                        .committed_through = committed_},
                       &effects_);
    heard_.clear();
    commands_.clear();
    committed_ = std::max(committed_, effects_.batch);
    job_ = effects_.plan_job;
    for (const OutFrame& out : effects_.frames)
      std::ranges::lower_bound(lines_, out.bus, {}, &Line::bus)
          ->transmit_queue.Put(out.frame, now_);
    for (Line& line : lines_) {
      if (line.transmit_queue.size() > 0) line.transmit_queue.Flush(line.port.get(), now_);
      if (saturating_) Poll(line.bus);
    }
  }
  // All units are stopped before they move, so the first plan serves for all.
  PlanDone PlanOf(const PlanJob& job) {
    if (!plan_) plan_ = RunPlanJob(job, layout_, coordinator_->drives());
    PlanDone done = *plan_;
    done.job = job.job;
    return done;
  }
  void Poll(BusId bus) {
    constexpr std::uint8_t kOtherHost = 200;
    for (std::size_t i = fleet_->world().waiting(bus); i < kPollsWaiting; ++i) {
      const Unit& unit = layout_.units()[rng_.Below(layout_.size())];
      fleet_->world().Inject(bus, Encode(HostMessage(StatusRequest{}), {unit.node, kOtherHost}),
                             now_, 1);
    }
  }

  Rng rng_;
  HostInstant now_{Seconds(1).ns};
  Layout layout_;
  std::vector<UnitDrive> drives_;
  std::shared_ptr<SimulatedFleet> fleet_;
  std::unique_ptr<Coordinator> coordinator_;
  std::deque<Line> lines_;
  std::vector<std::optional<Pose>> targets_;
  std::vector<ReceivedFrame> heard_;
  std::vector<sim::WireFrame> wire_;
  std::vector<Command> commands_;
  std::optional<PlanJob> job_;
  std::optional<PlanDone> plan_;
  Effects effects_;
  std::uint64_t committed_ = 0;
  std::uint64_t requests_ = 0;
  bool saturating_ = false;
};

int Main(int argc, char** argv) {
  const int buses = Option(argc, argv, "--buses", 50);
  const int units_per_bus = Option(argc, argv, "--units-per-bus", 100);
  const int stops = Option(argc, argv, "--stops", 200);
  const auto seed = static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1));
  StopBench bench(buses, units_per_bus, seed);
  Rng rng = Rng::Stream(seed, "instants");
  std::vector<double> worst;
  std::vector<double> median;
  double load_min = 1;
  for (int i = 0; i < stops; ++i) {
    const StopTaken stop = bench.Measure(Microseconds(static_cast<std::int64_t>(
        1000 + rng.Below(static_cast<std::uint64_t>(500 * units_per_bus)))));
    worst.push_back(stop.worst_bits / kFrameTimeBits);
    median.push_back(stop.median_bits / kFrameTimeBits);
    load_min = std::min(load_min, stop.load_min);
  }
  std::ranges::sort(worst);
  const auto at = [&](double share) {
    return worst[static_cast<std::size_t>(share * static_cast<double>(worst.size() - 1))];
  };
  std::printf("%d stops of %d buses with %d units each, least busy bus %.4f\n", stops, buses,
              units_per_bus, load_min);
  std::printf("command to end of arbitration, in frame times of %.0f us:\n", kFrameTimeBits);
  std::printf("  any bus   median %.3f\n", bench::Median(median));
  std::printf("  last bus  least %.3f  median %.3f  99 %% %.3f  worst %.3f\n", at(0), at(0.5),
              at(0.99), at(1));
  return at(1) <= 2 && load_min > 0.99 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
