// in_process_log CONFIG STATE_CSV TARGETS_CSV prints what candump would have logged, had the buses
// of one configuration been real. The coordinator, the planner and the simulated world run in this
// one process on virtual time. Units, drive and timing are those of the daemon's CONFIG. There is
// no socket, daemon or kernel in between. Interfaces are called vcan0, vcan1 ... by ascending
// bus_id. The exit code is 0 where all units arrived.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "daemon/ports/simulated_port.h"
#include "daemon/process/config.h"
#include "daemon/process/fleet_setup.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

constexpr DurationNs kTurn = Microseconds(200);  // of the loop, as the daemon's
constexpr DurationNs kCommit = Milliseconds(5);
constexpr DurationNs kPlanning = Milliseconds(20);

std::string ReadText(const char* path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

template <class T>
T OrEnd(Result<T> result) {
  if (result) return std::move(*result);
  std::fprintf(stderr, "in_process_log: %s\n", result.error().text.c_str());
  std::exit(1);
}

sim::WorldConfig Describe(const Layout& layout, const std::vector<std::optional<Pose>>& poses,
                          HostInstant start) {
  const UnitDrive factory;
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  config.start = start;
  for (std::size_t n = 0; n < layout.size(); ++n)
    for (const Axis axis : kAxes)
      if (poses[n])
        config.units[n].axis[Index(axis)].angle_deg =
            AngleDeg((*poses[n])[Index(axis)], layout.units()[n].axis[Index(axis)],
                     factory.axis[Index(axis)]);
  return config;
}

class Run {
 public:
  Run(const Layout& layout, const std::vector<std::optional<Pose>>& poses,
      const DaemonConfig& config)
      : layout_(layout),
        world_(Describe(layout, poses, now_)),
        coordinator_(&layout, std::vector<UnitDrive>(layout.size(), config.drive), config.timing,
                     {}) {
    for (std::size_t b = 0; b < layout.buses().size(); ++b) place_[layout.buses()[b]] = b;
  }

  bool AllReady() const {
    for (std::uint32_t n = 0; n < layout_.size(); ++n)
      if (coordinator_.unit({n}).phase != UnitPhase::kReady) return false;
    return true;
  }
  std::vector<UnitKnowledge> Knowledge() const {
    std::vector<UnitKnowledge> all;
    for (std::uint32_t n = 0; n < layout_.size(); ++n)
      all.push_back(coordinator_.unit({n}).knowledge);
    return all;
  }
  void Apply(std::vector<std::optional<Pose>> targets) {
    commands_.push_back({1, ApplyCommand{"targets.csv", std::move(targets), false}});
  }
  bool over() const {
    return std::ranges::any_of(replies_, [](const ReplyEffect& reply) { return reply.last; });
  }
  const Coordinator& coordinator() const { return coordinator_; }
  /// The largest difference between a rotor's true position and its unit's count. Units: vectors.
  double WorstSlip() const {
    double worst = 0;
    for (std::size_t n = 0; n < layout_.size(); ++n) {
      const sim::UnitTruth truth = world_.Truth(n);
      for (const Axis axis : kAxes)
        worst = std::max(worst, std::abs(truth.vectors[Index(axis)] - truth.applied[Index(axis)]));
    }
    return worst;
  }

  void Turn() {
    std::vector<ReceivedFrame> heard;
    std::vector<sim::WireFrame> wire;
    world_.AdvanceTo(now_, &heard, &wire);
    for (const sim::WireFrame& frame : wire) Print(frame);
    std::vector<PlanDone> plans;
    for (; !planning_.empty() && planning_.front().first <= now_; planning_.pop_front())
      plans.push_back(RunPlanJob(planning_.front().second, layout_, coordinator_.drives()));
    for (; !commits_.empty() && commits_.front().first <= now_; commits_.pop_front())
      committed_ = commits_.front().second;
    effects_.Clear();
    coordinator_.Step({.now = now_,
                       .frames = heard,
                       .links = {},
                       .commands = commands_,
                       .plans = plans,
                       .committed_through = committed_},
                      &effects_);
    commands_.clear();
    if (!effects_.rows.empty()) commits_.push_back({now_ + kCommit, effects_.batch});
    for (const OutFrame& out : effects_.frames) world_.Inject(out.bus, out.frame, now_);
    if (effects_.plan_job) planning_.push_back({now_ + kPlanning, *effects_.plan_job});
    replies_.insert(replies_.end(), effects_.replies.begin(), effects_.replies.end());
    HostInstant next = std::min(effects_.wake_at, world_.NextEvent());
    if (!commits_.empty()) next = std::min(next, commits_.front().first);
    if (!planning_.empty()) next = std::min(next, planning_.front().first);
    now_ = std::max(next, now_ + kTurn);
  }

 private:
  void Print(const sim::WireFrame& wire) const {
    std::printf("(%lld.%06lld) vcan%zu %08X#", static_cast<long long>(wire.at.ns / 1'000'000'000),
                static_cast<long long>(wire.at.ns / 1000 % 1'000'000), place_.at(wire.bus),
                wire.frame.id);
    for (const std::uint8_t byte : wire.frame.payload()) std::printf("%02X", byte);
    std::putchar('\n');
  }

  HostInstant now_{Seconds(1).ns};
  const Layout& layout_;
  sim::World world_;
  Coordinator coordinator_;
  std::map<BusId, std::size_t> place_;
  std::deque<std::pair<HostInstant, std::uint64_t>> commits_;
  std::deque<std::pair<HostInstant, PlanJob>> planning_;
  std::uint64_t committed_ = 0;
  std::vector<Command> commands_;
  std::vector<ReplyEffect> replies_;
  Effects effects_;
};

int Main(char** arguments) {
  const DaemonConfig config = OrEnd(LoadConfig(arguments[1]));
  const Layout layout = OrEnd(LoadLayout(config.fleet));
  const std::vector<UnitDrive> factory(layout.size());
  const auto poses = OrEnd(ReadState(ReadText(arguments[2]), arguments[2], layout, factory));
  Run run(layout, poses, config);
  while (!run.AllReady()) run.Turn();
  const Targets targets = OrEnd(ReadTargets(ReadText(arguments[3]), arguments[3]));
  run.Apply(OrEnd(ResolveTargets(targets, layout, run.coordinator().drives(), run.Knowledge())));
  while (!run.over()) run.Turn();
  const ConfigurationView& end = run.coordinator().configuration();
  std::fprintf(stderr,
               "in-process: %u of %u arrived, makespan %.1f s, rotors within %.1f vectors\n",
               end.counts.arrived, end.counts.targeted, end.makespan_s, run.WorstSlip());
  // A drive too fast for the motor would leave rotors whole electrical turns behind, of 96 vectors.
  return end.counts.arrived == layout.size() && run.WorstSlip() < 48 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) {
  if (count != 4) {
    std::fputs("usage: in_process_log CONFIG STATE_CSV TARGETS_CSV\n", stderr);
    return 2;
  }
  return focalfleet::Main(arguments);
}
