// This bench gives new targets to single units of a running configuration. At random instants of
// random plans one unit is stopped, with those that follow it, and finds a new way among all others
// as they go.
//   replan_bench --units 5000 --plans 2 --replans 100 --seed 1
// The output is CPU milliseconds of one answer: median, 95 %, worst; and the share that found a
// way.
#include <ctime>
#include <memory>
#include <set>

#include "fleet/hex_layout.h"
#include "fleet/plan/replan.h"
#include "fleet/targets.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;

double CpuMs() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

class Bench {
 public:
  Bench(const Layout& layout, std::uint64_t seed)
      : layout_(layout),
        drives_(layout.size()),
        frozen_(layout.size(), 0),
        rng_(Rng::Stream(seed, "replan bench")),
        seed_(seed) {}

  bool Begin() {
    const std::vector<std::optional<Pose>> anywhere(layout_.size());
    const auto from = DrawConfiguration(layout_, drives_, anywhere, Rng::Stream(seed_, "start"));
    const auto to = DrawConfiguration(layout_, drives_, anywhere, Rng::Stream(seed_, "target"));
    if (!from || !to) return false;
    for (const Pose& pose : *from) start_.push_back(Exactly(Witness::kReported, pose));
    targets_.assign(to->begin(), to->end());
    const PlanRequest request{.layout = &layout_,
                              .drives = drives_,
                              .start = start_,
                              .targets = targets_,
                              .frozen = frozen_};
    auto plan = MakePlan(request, {});
    if (!plan) return false;
    plan_ = std::move(*plan);
    move_of_.assign(layout_.size(), nullptr);
    for (const UnitPlan& move : plan_.moves) move_of_[move.unit.value] = &move;
    const double begin_ms = CpuMs();
    running_ = std::make_unique<RunningPlan>(request, plan_.moves, PlanOptions{});
    setup_ms = CpuMs() - begin_ms;
    return true;
  }

  void ReplanOne() {
    const double t_s = rng_.Uniform(0, plan_.makespan_s);
    const auto unit = static_cast<std::uint32_t>(rng_.Below(layout_.size()));
    std::vector<std::optional<Pose>> ends;
    for (std::uint32_t i = 0; i < layout_.size(); ++i)
      ends.emplace_back(move_of_[i] != nullptr ? move_of_[i]->to : PlaceOf(start_[i]));
    std::vector<Deviation> deviations;
    for (const std::uint32_t i : StoppedWith(unit, t_s)) {
      const UnitPlan& move = *move_of_[i];
      Pose pose = move.from;
      for (std::size_t k = 0; k < kAxisCount; ++k)
        pose[k] = PositionAt(pose[k], move.path[k], drives_[i].axis[k], t_s);
      ends[i] = pose;
      deviations.push_back({{i}, Exactly(Witness::kReported, pose), std::nullopt});
    }
    const Pose from = *ends[unit];
    ends[unit].reset();
    const auto target =
        DrawConfiguration(layout_, drives_, ends, Rng::Stream(rng_.Bits(), "new target"));
    if (!target) return;
    const double begin_ms = CpuMs();
    const auto late = running_->Replan({.unit = {unit},
                                        .from = from,
                                        .to = (*target)[unit],
                                        .now_s = t_s + 0.5,
                                        .start_s = t_s + 2},
                                       deviations);
    ms.push_back(CpuMs() - begin_ms);
    if (late) {
      ++served;
      over_s.push_back(late->end_s - plan_.makespan_s);
    } else {
      refused_ms.push_back(ms.back());
    }
  }

  double setup_ms = 0;
  int served = 0;
  std::vector<double> ms;
  std::vector<double> refused_ms;
  std::vector<double> over_s;  // delay of its end after the last of the others

 private:
  /// The unit, if it moves, and all units that follow those that are stopped.
  [[nodiscard]] std::set<std::uint32_t> StoppedWith(std::uint32_t unit, double t_s) const {
    std::set<std::uint32_t> stopped;
    std::vector<std::uint32_t> open{unit};
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      if (move_of_[i] == nullptr || EndOf(*move_of_[i], drives_[i]) <= t_s) continue;
      if (!stopped.insert(i).second) continue;
      for (const UnitPlan::Follower& follower : move_of_[i]->followers)
        if (follower.since_s <= t_s && t_s <= follower.left_s) open.push_back(follower.unit.value);
    }
    return stopped;
  }

  const Layout& layout_;
  std::vector<UnitDrive> drives_;
  std::vector<std::uint8_t> frozen_;
  std::vector<UnitKnowledge> start_;
  std::vector<std::optional<Pose>> targets_;
  Plan plan_;
  std::vector<const UnitPlan*> move_of_;
  std::unique_ptr<RunningPlan> running_;
  Rng rng_;
  std::uint64_t seed_;
};

int Run(int argc, char** argv) {
  const auto count = static_cast<std::uint32_t>(Option(argc, argv, "--units", 5000));
  const int plans = Option(argc, argv, "--plans", 2);
  const int replans = Option(argc, argv, "--replans", 100);
  const auto seed = static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1));
  const bool dense = Option(argc, argv, "--layout", 0) == 2;
  const auto layout =
      Layout::Create(MakeHexLayout(dense ? SdssLike(count) : HexLayoutOptions{.count = count}), {});
  if (!layout) return std::fprintf(stderr, "%s\n", layout.error().text.c_str()), 2;
  std::vector<double> all_ms;
  std::vector<double> refused_ms;
  std::vector<double> over_s;
  double setup_ms = 0;
  int served = 0;
  for (int p = 0; p < plans; ++p) {
    Bench bench(*layout, seed + static_cast<std::uint64_t>(p));
    if (!bench.Begin()) return std::fprintf(stderr, "no plan\n"), 1;
    for (int n = 0; n < replans; ++n) bench.ReplanOne();
    all_ms.insert(all_ms.end(), bench.ms.begin(), bench.ms.end());
    refused_ms.insert(refused_ms.end(), bench.refused_ms.begin(), bench.refused_ms.end());
    over_s.insert(over_s.end(), bench.over_s.begin(), bench.over_s.end());
    served += bench.served;
    setup_ms = std::max(setup_ms, bench.setup_ms);
  }
  if (all_ms.empty()) return 1;
  std::sort(all_ms.begin(), all_ms.end());
  std::printf(
      "%zu units, %zu replans of one unit: CPU median %.3f ms, 95 %% %.3f ms, worst %.3f ms (of "
      "those refused %.3f ms); %d served (%.1f %%), in time with the others %d; made ready in "
      "%.1f ms a configuration\n",
      layout->size(), all_ms.size(), Median(all_ms), all_ms[all_ms.size() * 95 / 100],
      all_ms.back(),
      refused_ms.empty() ? 0 : *std::max_element(refused_ms.begin(), refused_ms.end()), served,
      100.0 * served / static_cast<double>(all_ms.size()),
      static_cast<int>(std::count_if(over_s.begin(), over_s.end(), [](double s) { return s < 1; })),
      setup_ms);
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Run(argc, argv); }
