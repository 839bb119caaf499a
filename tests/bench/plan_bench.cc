// This bench plans from random configuration to random configuration. Each gives one line: makespan
// over the lower bound, CPU seconds, and units that were not served. The independent checker runs
// on request. A summary stands at the end.
//   plan_bench --layout 0 --units 5000 --configurations 100 --seed 1 --check 1
// --beside retract: the least time of the method of other systems: all fold into their cells, all
// rotate, all extend, each when the last one has ended, if no unit ever met another. --plot FILE:
// the distribution of both, SVG. --objective 1, 2, 3: least energy, least peak, even power.
// --layout 0 hexagonal, 1 the plate of the file FOCALFLEET_DESI_UNITS names, 2 SDSS-like, 3
// PFS-like, 4 MOONS-like (plates.h). --obstacles N, --rim 1: what stands among and around the
// units.
// --broken-percent P: so many units stand for good, anywhere in their patrol areas.
// --improve-cpu-ms N, --rail-limit-percent P (of the free plan's peak).
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <fstream>

#include "fleet/plan/planner.h"
#include "fleet/plan/power_statement.h"
#include "fleet/plan/scene.h"
#include "fleet/targets.h"
#include "tests/bench/options.h"
#include "tests/bench/plates.h"
#include "tests/bench/ratio_plot.h"
#include "tests/fleet/plan/plan_rows.h"

namespace focalfleet {
namespace {

using bench::kPlateKinds;
using bench::MakePlate;
using bench::Median;
using bench::NameOf;
using bench::Option;
using bench::Plate;
using bench::PlateKind;
using bench::PlateOptions;
using bench::PlotRatios;
using bench::TextOption;

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The duration of the slowest served unit's shortest move alone. Units: s.
double BoundOf(const PlanRequest& request, const Plan& plan) {
  std::vector<std::uint8_t> served(request.layout->size(), 1);
  for (const Unserved& unserved : plan.unserved) served[unserved.unit.value] = 0;
  double bound_s = 0;
  for (std::uint32_t i = 0; i < request.layout->size(); ++i) {
    if (!request.targets[i] || served[i] == 0) continue;
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
  double pair_ratio = 0;  // over the bound that knows neighbours
  double retract_ratio = 0;
  double cpu_s = 0;
};

/// A random start and random targets. Shape: all (n).
struct Drawn {
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
};

/// A percentage of the units stands where they start, whatever comes.
Result<Drawn> DrawnFrom(const Layout& layout, std::span<const UnitDrive> drives, std::uint64_t seed,
                        int broken_percent) {
  const std::size_t n = layout.size();
  Drawn drawn{{}, std::vector<std::optional<Pose>>(n), std::vector<std::uint8_t>(n, 0)};
  std::vector<std::optional<Pose>> standing(n);
  FOCALFLEET_TRY_ASSIGN(const std::vector<Pose> from,
                        DrawConfiguration(layout, drives, standing, Rng::Stream(seed, "start")));
  Rng lot = Rng::Stream(seed, "broken");
  for (std::uint32_t i = 0; i < n; ++i) {
    drawn.start.push_back(Exactly(Witness::kReported, from[i]));
    drawn.frozen[i] = lot.Below(100) < static_cast<std::uint64_t>(broken_percent) ? 1 : 0;
    if (drawn.frozen[i] != 0 || !layout.unit({i}).enabled) standing[i] = from[i];
  }
  FOCALFLEET_TRY_ASSIGN(const std::vector<Pose> to,
                        DrawConfiguration(layout, drives, standing, Rng::Stream(seed, "target")));
  for (std::uint32_t i = 0; i < n; ++i)
    if (!standing[i]) drawn.targets[i] = to[i];
  return drawn;
}

class Bench {
 public:
  Bench(int argc, char** argv)
      : plate_{.kind = static_cast<PlateKind>(Option(argc, argv, "--layout", 0) % kPlateKinds),
               .count = static_cast<std::uint32_t>(Option(argc, argv, "--units", 5000)),
               .obstacles = static_cast<std::uint32_t>(Option(argc, argv, "--obstacles", 0)),
               .rim = Option(argc, argv, "--rim", 0) != 0},
        configurations_(Option(argc, argv, "--configurations", 10)),
        seed_(static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1))),
        broken_percent_(Option(argc, argv, "--broken-percent", 0)),
        rail_limit_percent_(Option(argc, argv, "--rail-limit-percent", 0)),
        check_(Option(argc, argv, "--check", 0) != 0),
        beside_(std::string(TextOption(argc, argv, "--beside")) == "retract"),
        plot_(TextOption(argc, argv, "--plot")) {
    options_.power.rail_W = Option(argc, argv, "--rail-limit-mw", 0) * 1e-3;
    options_.improve_cpu_s = Option(argc, argv, "--improve-cpu-ms", 1000) * 1e-3;
    options_.objective = static_cast<Objective>(Option(argc, argv, "--objective", 0) % 4);
  }

  int Run();

 private:
  Status RunOne(const Layout& layout, std::uint64_t seed);
  Status LimitRails(const Layout& layout, const PlanRequest& request);
  std::string VerdictOn(const Layout& layout, const PlanRequest& request, const Plan& plan) const;
  void PrintSummary(std::size_t units) const;

  PlateOptions plate_;
  int configurations_;
  std::uint64_t seed_;
  int broken_percent_;
  int rail_limit_percent_;
  bool check_;
  bool beside_;
  std::string plot_;
  PlanOptions options_;
  std::vector<Row> rows_;
  int faults_ = 0;
};

/// The limit is a share of the peak that the plan has without one.
Status Bench::LimitRails(const Layout& layout, const PlanRequest& request) {
  options_.power = {};
  FOCALFLEET_TRY_ASSIGN(const Plan free, MakePlan(request, options_));
  const PowerStatement power = StatePower(free, layout, request.drives, options_);
  options_.power.rail_W = power.LargestRail_W() * rail_limit_percent_ / 100;
  return {};
}

std::string Bench::VerdictOn(const Layout& layout, const PlanRequest& request,
                             const Plan& plan) const {
  if (!check_) return "-";
  test::CheckOptions options;
  options.clearance_mm = layout.clearance_mm();
  const auto report = test::CheckPlan(
      test::CheckedUnits(layout, request.drives, request.start, request.frozen),
      test::CheckedRows(plan, layout, request.drives), test::CheckedObstacles(layout), options);
  return report.ok() ? "clear" : report.Text();
}

Status Bench::RunOne(const Layout& layout, std::uint64_t seed) {
  const std::vector<UnitDrive> drives(layout.size());
  FOCALFLEET_TRY_ASSIGN(const Drawn drawn, DrawnFrom(layout, drives, seed, broken_percent_));
  const PlanRequest request{.layout = &layout,
                            .drives = drives,
                            .start = drawn.start,
                            .targets = drawn.targets,
                            .frozen = drawn.frozen};
  if (rail_limit_percent_ > 0) FOCALFLEET_TRY(LimitRails(layout, request));
  const double begin_s = CpuSeconds();
  FOCALFLEET_TRY_ASSIGN(const Plan plan, MakePlan(request, options_));
  const double cpu_s = CpuSeconds() - begin_s;
  const double bound_s = BoundOf(request, plan);
  rows_.push_back({plan.makespan_s / bound_s, plan.makespan_s / plan.pair_bound_s,
                   RetractOf(request) / bound_s, cpu_s});
  if (beside_) std::printf("retract-rotate-extend %.4f; ", rows_.back().retract_ratio);
  const PowerStatement power = StatePower(plan, layout, drives, options_);
  double rail_peak_W = 0;
  for (const RailStatement& rail : power.rails) rail_peak_W = std::max(rail_peak_W, rail.peak_W);
  std::printf(
      "energy %.1f J, largest rail's peak %.2f W (at most %.2f W, limit %.2f W), total peak %.2f W "
      "(at most %.2f W), flatness %.3f; ",
      power.energy_J, rail_peak_W, power.LargestRail_W(), options_.power.rail_W, power.peak_W,
      power.peak_most_W, power.flatness);
  const bool over_limit =
      options_.power.rail_W > 0 && power.LargestRail_W() > options_.power.rail_W + 1e-9;
  const std::string verdict = VerdictOn(layout, request, plan);
  // A unit that provably has no way at all is no fault of the plan.
  const auto proven = static_cast<std::size_t>(
      std::count_if(plan.unserved.begin(), plan.unserved.end(),
                    [](const Unserved& unserved) { return unserved.proof.has_value(); }));
  if (proven != plan.unserved.size() || (check_ && verdict != "clear") || over_limit) ++faults_;
  std::printf(
      "seed %llu bound %.2f s pair bound %.2f s makespan %.2f s ratio %.4f pair ratio %.4f cpu "
      "%.3f s unserved %zu (%zu proven) crossing %u unnoticed %zu clearance %.1f um at %.2f s %s\n",
      static_cast<unsigned long long>(seed), bound_s, plan.pair_bound_s, plan.makespan_s,
      rows_.back().ratio, rows_.back().pair_ratio, cpu_s, plan.unserved.size(), proven,
      plan.crossings, plan.unnoticed.size(),
      plan.tightest.empty() ? 0 : 1e3 * plan.tightest.front().clearance_mm,
      plan.tightest.empty() ? 0 : plan.tightest.front().t_s, verdict.c_str());
  std::fflush(stdout);
  return {};
}

void Bench::PrintSummary(std::size_t units) const {
  const auto column = [&](double Row::*field) {
    std::vector<double> values;
    for (const Row& row : rows_) values.push_back(row.*field);
    return values;
  };
  const auto worst = [](const std::vector<double>& values) {
    return *std::max_element(values.begin(), values.end());
  };
  const std::vector<double> ratios = column(&Row::ratio);
  const std::vector<double> pairs = column(&Row::pair_ratio);
  const std::vector<double> retract = column(&Row::retract_ratio);
  const std::vector<double> cpu = column(&Row::cpu_s);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "%s, %zu units, %zu configurations: ratio median %.4f worst %.4f, pair ratio median %.4f "
      "worst %.4f, cpu median %.3f s worst %.3f s, memory %ld MiB, %d with faults\n",
      NameOf(plate_.kind), units, rows_.size(), Median(ratios), worst(ratios), Median(pairs),
      worst(pairs), Median(cpu), worst(cpu), usage.ru_maxrss / 1024, faults_);
  if (beside_)
    std::printf("retract-rotate-extend: ratio median %.4f worst %.4f at least\n", Median(retract),
                worst(retract));
  if (plot_.empty()) return;
  std::ofstream(plot_) << PlotRatios(
      std::string(NameOf(plate_.kind)) + ", " + std::to_string(units) + " units, " +
          std::to_string(rows_.size()) + " random configurations",
      {{"focalfleet", "#06c", ratios}, {"retract, rotate, extend, at least", "#c40", retract}});
}

int Bench::Run() {
  Plate plate = MakePlate(plate_);
  auto layout = Layout::Create(std::move(plate.units), {.obstacles = std::move(plate.obstacles)});
  if (!layout || layout->size() == 0) return std::fprintf(stderr, "no such layout\n"), 2;
  for (int c = 0; c < configurations_; ++c) {
    const Status done = RunOne(*layout, seed_ + static_cast<std::uint64_t>(c));
    if (!done) return std::fprintf(stderr, "%s\n", done.error().text.c_str()), 1;
  }
  PrintSummary(layout->size());
  return faults_ == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Bench(argc, argv).Run(); }
