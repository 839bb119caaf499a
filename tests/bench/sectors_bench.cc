// This bench plans the same configurations as one plan and by 2, 3, 4 and 7 sectors. The bench
// prints makespan and CPU time (of all sectors together) over the one plan's, and how often sectors
// were merged into one. The independent checker runs on request.
//   sectors_bench --units 5000 --configurations 5 --seed 1 --check 1
#include <algorithm>
#include <ctime>

#include "fleet/hex_layout.h"
#include "fleet/plan/sectors.h"
#include "fleet/targets.h"
#include "tests/bench/options.h"
#include "tests/fleet/plan/plan_rows.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Figures {
  std::vector<double> ratio;
  std::vector<double> cpu;
  std::uint32_t merged = 0;
  int faults = 0;
};

struct Fleet {
  Layout layout;
  std::vector<UnitDrive> drives;
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
  [[nodiscard]] PlanRequest request() const {
    return {
        .layout = &layout, .drives = drives, .start = start, .targets = targets, .frozen = frozen};
  }
};

bool Draw(std::uint64_t seed, Fleet* fleet) {
  const std::vector<std::optional<Pose>> standing(fleet->layout.size());
  const auto from =
      DrawConfiguration(fleet->layout, fleet->drives, standing, Rng::Stream(seed, "start"));
  const auto to =
      DrawConfiguration(fleet->layout, fleet->drives, standing, Rng::Stream(seed, "target"));
  if (!from || !to) return false;
  fleet->start.clear();
  for (const Pose& pose : *from) fleet->start.push_back(Exactly(Witness::kReported, pose));
  fleet->targets.assign(to->begin(), to->end());
  return true;
}

bool IsClear(const Fleet& fleet, const Plan& plan) {
  test::CheckOptions options;
  options.clearance_mm = fleet.layout.clearance_mm();
  return test::CheckPlan(test::CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
                         test::CheckedRows(plan, fleet.layout, fleet.drives),
                         test::CheckedObstacles(fleet.layout), options)
      .ok();
}

int Run(int argc, char** argv) {
  const auto count = static_cast<std::uint32_t>(Option(argc, argv, "--units", 5000));
  const int configurations = Option(argc, argv, "--configurations", 5);
  const auto seed = static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1));
  const bool check = Option(argc, argv, "--check", 0) != 0;
  auto layout = Layout::Create(MakeHexLayout({.count = count}), {});
  if (!layout) return std::fprintf(stderr, "%s\n", layout.error().text.c_str()), 2;
  const std::size_t n = layout->size();
  Fleet fleet{
      std::move(*layout), std::vector<UnitDrive>(n), {}, {}, std::vector<std::uint8_t>(n, 0)};
  constexpr std::uint32_t kCounts[] = {2, 3, 4, 7};
  std::vector<Figures> figures(std::size(kCounts));
  int faults = 0;
  for (int c = 0; c < configurations; ++c) {
    if (!Draw(seed + static_cast<std::uint64_t>(c), &fleet)) return 1;
    double begin_s = CpuSeconds();
    const auto one = MakePlan(fleet.request(), {});
    const double one_cpu_s = CpuSeconds() - begin_s;
    if (!one) return std::fprintf(stderr, "%s\n", one.error().text.c_str()), 1;
    for (std::size_t k = 0; k < std::size(kCounts); ++k) {
      begin_s = CpuSeconds();
      const auto made = PlanBySectors(fleet.request(), {}, {.count = kCounts[k]});
      const double cpu_s = CpuSeconds() - begin_s;
      if (!made) return std::fprintf(stderr, "%s\n", made.error().text.c_str()), 1;
      const double ratio = made->plan.makespan_s / one->makespan_s;
      figures[k].ratio.push_back(ratio);
      figures[k].cpu.push_back(cpu_s / std::max(one_cpu_s, 1e-6));
      figures[k].merged += made->merged;
      const bool good = made->plan.unserved.empty() && (!check || IsClear(fleet, made->plan));
      if (!good) ++faults;
      std::printf(
          "seed %llu sectors %u merged %u makespan %.2f s, one plan %.2f s, ratio %.4f cpu %.2f s, "
          "one plan %.2f s%s\n",
          static_cast<unsigned long long>(seed + static_cast<std::uint64_t>(c)), kCounts[k],
          made->merged, made->plan.makespan_s, one->makespan_s, ratio, cpu_s, one_cpu_s,
          good ? "" : " FAULT");
      std::fflush(stdout);
    }
  }
  for (std::size_t k = 0; k < std::size(kCounts); ++k) {
    const auto& ratio = figures[k].ratio;
    std::printf(
        "%zu units, %u sectors, %d configurations: makespan over one plan's median %.4f worst "
        "%.4f, cpu over one plan's median %.2f, %u merged\n",
        n, kCounts[k], configurations, Median(ratio), *std::max_element(ratio.begin(), ratio.end()),
        Median(figures[k].cpu), figures[k].merged);
  }
  std::printf("%d with faults\n", faults);
  return faults == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Run(argc, argv); }
