// This bench plans from random configuration to random configuration. Each gives one line: makespan
// over the lower bound, CPU seconds, and units that were not served. The independent checker runs
// on request. A summary stands at the end.
//   plan_bench --layout 0 --units 5000 --configurations 100 --seed 1 --check 1
// --beside retract: the least time of the method of other systems: all fold into their cells, all
// rotate, all extend, each when the last one has ended, if no unit ever met another. --plot FILE:
// the distribution of both, SVG. --objective 1, 2, 3: least energy, least peak, even power.
// --layout 0 hexagonal, 1 the plate of the file FOCALFLEET_DESI_UNITS names, 2 SDSS-like.
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>

#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/power_statement.h"
#include "fleet/plan/scene.h"
#include "fleet/targets.h"
#include "tests/bench/options.h"
#include "tests/bench/ratio_plot.h"
#include "tests/fleet/plan/plan_rows.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;
using bench::PlotRatios;
using bench::TextOption;

std::vector<Unit> UnitsOf(int layout, std::uint32_t count) {
  if (layout == 0) return MakeHexLayout({.count = count});
  if (layout == 2) return MakeHexLayout(SdssLike(count));
  const char* path = std::getenv("FOCALFLEET_DESI_UNITS");
  if (path == nullptr) return {};
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  auto read = ReadUnits(text.str(), path);
  return read ? std::move(read->units) : std::vector<Unit>{};
}

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The duration of the slowest unit's shortest move alone. Units: s.
double BoundOf(const PlanRequest& request) {
  double bound_s = 0;
  for (std::uint32_t i = 0; i < request.layout->size(); ++i) {
    if (!request.targets[i] || request.frozen[i] != 0) continue;
    const Pose from = PlaceOf(request.start[i]);
    for (std::size_t k = 0; k < kAxisCount; ++k)
      bound_s = std::max(bound_s, std::abs((*request.targets[i])[k] - from[k]) *
                                      SecondsPerVector(request.drives[i].axis[k]));
  }
  return bound_s;
}

/// The duration of fold, rotate, extend with a barrier after each. Units: s.
double RetractOf(const PlanRequest& request) {
  const Scene scene(*request.layout, request.drives, request.start);
  std::array<double, 3> stage_s{};
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    if (!request.targets[i] || request.frozen[i] != 0) continue;
    const Pose from = PlaceOf(request.start[i]);
    const Pose to = *request.targets[i];
    const std::int32_t low = scene.HasCell(i) ? scene.cell(i).low : scene.arm(i).range().high[1];
    const auto& axis = request.drives[i].axis;
    const auto take = [&](std::size_t stage, std::size_t k, std::int32_t vectors) {
      stage_s[stage] = std::max(stage_s[stage], std::abs(vectors) * SecondsPerVector(axis[k]));
    };
    take(0, 1, std::max(low - from[1], 0));
    take(1, 0, to[0] - from[0]);
    take(2, 1, std::max(low - to[1], 0));
  }
  return stage_s[0] + stage_s[1] + stage_s[2];
}

struct Row {
  double ratio = 0;
  double retract_ratio = 0;
  double cpu_s = 0;
};

int Run(int argc, char** argv) {
  const int kind = Option(argc, argv, "--layout", 0);
  const auto count = static_cast<std::uint32_t>(Option(argc, argv, "--units", 5000));
  const int configurations = Option(argc, argv, "--configurations", 10);
  const auto seed = static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1));
  const double rail_limit_W = Option(argc, argv, "--rail-limit-mw", 0) * 1e-3;
  const bool check = Option(argc, argv, "--check", 0) != 0;
  const bool beside = std::string(TextOption(argc, argv, "--beside")) == "retract";
  const std::string plot = TextOption(argc, argv, "--plot");
  auto layout = Layout::Create(UnitsOf(kind, count), {});
  if (!layout || layout->size() == 0) return std::fprintf(stderr, "no such layout\n"), 2;
  const std::size_t n = layout->size();
  const std::vector<UnitDrive> drives(n);
  std::vector<std::uint8_t> frozen(n, 0);
  std::vector<Row> rows;
  int faults = 0;
  for (int c = 0; c < configurations; ++c) {
    std::vector<std::optional<Pose>> standing(n);
    const auto draw = [&](const char* what) {
      return DrawConfiguration(*layout, drives, standing,
                               Rng::Stream(seed + static_cast<std::uint64_t>(c), what));
    };
    const auto from = draw("start");
    if (!from) return std::fprintf(stderr, "%s\n", from.error().text.c_str()), 1;
    std::vector<UnitKnowledge> start;
    for (const Pose& pose : *from) start.push_back(Exactly(Witness::kReported, pose));
    for (std::uint32_t i = 0; i < n; ++i)
      if (!layout->unit({i}).enabled) standing[i] = (*from)[i];
    const auto to = draw("target");
    if (!to) return std::fprintf(stderr, "%s\n", to.error().text.c_str()), 1;
    std::vector<std::optional<Pose>> targets(to->begin(), to->end());
    for (std::uint32_t i = 0; i < n; ++i)
      if (!layout->unit({i}).enabled) targets[i].reset();
    const PlanRequest request{
        .layout = &*layout, .drives = drives, .start = start, .targets = targets, .frozen = frozen};
    const double begin_s = CpuSeconds();
    PlanOptions options;
    options.power.rail_W = rail_limit_W;
    options.objective = static_cast<Objective>(Option(argc, argv, "--objective", 0) % 4);
    const auto plan = MakePlan(request, options);
    const double cpu_s = CpuSeconds() - begin_s;
    if (!plan) return std::fprintf(stderr, "%s\n", plan.error().text.c_str()), 1;
    const double bound_s = BoundOf(request);
    rows.push_back({plan->makespan_s / bound_s, RetractOf(request) / bound_s, cpu_s});
    if (beside) std::printf("retract-rotate-extend %.4f; ", rows.back().retract_ratio);
    const PowerStatement power = StatePower(*plan, *layout, drives, options);
    double rail_peak_W = 0;
    for (const RailStatement& rail : power.rails) rail_peak_W = std::max(rail_peak_W, rail.peak_W);
    std::printf(
        "energy %.1f J, largest rail's peak %.2f W (at most %.2f W), total peak %.2f W (at most "
        "%.2f W), flatness %.3f; ",
        power.energy_J, rail_peak_W, power.LargestRail_W(), power.peak_W, power.peak_most_W,
        power.flatness);
    std::string verdict = "-";
    if (check) {
      test::CheckOptions check_options;
      check_options.clearance_mm = layout->clearance_mm();
      const auto report = test::CheckPlan(test::CheckedUnits(*layout, drives, start, frozen),
                                          test::CheckedRows(*plan, *layout, drives),
                                          test::CheckedObstacles(*layout), check_options);
      verdict = report.ok() ? "clear" : report.Text();
    }
    // A unit that provably has no way at all is no fault of the plan.
    const auto proven = static_cast<std::size_t>(
        std::count_if(plan->unserved.begin(), plan->unserved.end(),
                      [](const Unserved& unserved) { return unserved.proof.has_value(); }));
    if (proven != plan->unserved.size() || (check && verdict != "clear")) ++faults;
    std::printf(
        "seed %llu bound %.2f s makespan %.2f s ratio %.4f cpu %.3f s unserved %zu (%zu proven) "
        "crossing %u "
        "unnoticed %zu clearance %.1f um at %.2f s %s\n",
        static_cast<unsigned long long>(seed + static_cast<std::uint64_t>(c)), bound_s,
        plan->makespan_s, rows.back().ratio, cpu_s, plan->unserved.size(), proven, plan->crossings,
        plan->unnoticed.size(),
        plan->tightest.empty() ? 0 : 1e3 * plan->tightest.front().clearance_mm,
        plan->tightest.empty() ? 0 : plan->tightest.front().t_s, verdict.c_str());
    std::fflush(stdout);
  }
  std::vector<double> ratios;
  std::vector<double> retract;
  std::vector<double> cpu;
  for (const Row& row : rows) {
    ratios.push_back(row.ratio);
    retract.push_back(row.retract_ratio);
    cpu.push_back(row.cpu_s);
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "%zu units, %d configurations: ratio median %.4f worst %.4f, cpu median %.3f s worst %.3f s, "
      "memory %ld MiB, %d with faults\n",
      n, configurations, Median(ratios), *std::max_element(ratios.begin(), ratios.end()),
      Median(cpu), *std::max_element(cpu.begin(), cpu.end()), usage.ru_maxrss / 1024, faults);
  if (beside)
    std::printf("retract-rotate-extend: ratio median %.4f worst %.4f at least\n", Median(retract),
                *std::max_element(retract.begin(), retract.end()));
  if (!plot.empty()) {
    const char* kinds[] = {"hexagonal", "DESI's plate", "SDSS-like"};
    std::ofstream(plot) << PlotRatios(
        std::string(kinds[kind % 3]) + ", " + std::to_string(n) + " units, " +
            std::to_string(configurations) + " random configurations",
        {{"focalfleet", "#06c", ratios}, {"retract, rotate, extend, at least", "#c40", retract}});
  }
  return faults == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Run(argc, argv); }
