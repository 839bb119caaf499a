// The command plan plans from a state to targets, offline. Nothing moves. The file that it writes
// can be checked by any program, or looked at.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ctime>
#include <set>

#include "daemon/cli/command_line.h"
#include "daemon/cli/offline_fleet.h"
#include "daemon/cli/start_check.h"
#include "daemon/files/text_file.h"
#include "daemon/report/plan_page.h"
#include "daemon/report/plan_picture.h"
#include "fleet/estimate.h"
#include "fleet/files/plan_file.h"
#include "fleet/plan/power_statement.h"

namespace focalfleet::cli {
namespace {

struct PlanCommandOptions {
  FleetFiles files;
  std::string targets;
  std::string from;
  std::string store;  // empty: none
  PlanOptions plan;
  std::uint32_t sectors = 1;
  std::string out;
  std::string plot;  // empty: none
};

struct Planned {
  OfflineFleet fleet;
  std::size_t targeted = 0;
  Plan plan;
  std::uint32_t sectors = 1;
  PlanEstimate estimate;
  PowerStatement power;
  StartVerdict starts;
  std::size_t rows = 0;
};

std::vector<report::RailLimit> RailLimitsOf(const PlanCommandOptions& options,
                                            const OfflineFleet& fleet) {
  std::set<std::uint32_t> rails;
  if (options.plan.power.rail_W > 0)
    for (const Unit& unit : fleet.layout.units()) rails.insert(unit.rail.value);
  std::vector<report::RailLimit> limits;
  for (const std::uint32_t rail : rails)
    limits.push_back({RailId{rail}, options.plan.power.rail_W});
  return limits;
}

constexpr double kPictureSpeed = 4;  // times as fast as the plan: nobody watches a minute

/// The page, or the picture where the file's name says so.
std::string PlotOf(const PlanCommandOptions& options, const OfflineFleet& fleet,
                   const StatePoses& state, const OfflinePlan& planned) {
  const report::PlanScene scene{
      .title = fmt::format("Plan: {} from {}", options.targets, options.from),
      .layout = &fleet.layout,
      .drives = fleet.drives,
      .start = state,
      .targets = planned.targets,
      .plan = &planned.plan,
      .rail_limits = RailLimitsOf(options, fleet)};
  return options.plot.ends_with(".svg") ? report::PlanPicture(scene, kPictureSpeed)
                                        : report::PlanPage(scene);
}

Result<Planned> MakeAndWrite(const Context& context, const PlanCommandOptions& options) {
  FOCALFLEET_TRY_ASSIGN(OfflineFleet fleet, LoadFleet(context, options.files));
  FOCALFLEET_TRY(TakeTuned(options.store, &fleet));
  FOCALFLEET_TRY_ASSIGN(const auto state, LoadState(options.from, fleet, WhoseState::kAll));
  FOCALFLEET_TRY_ASSIGN(OfflinePlan planned, PlanOffline(context, fleet, state,
                                                         {.targets = options.targets,
                                                          .from = options.from,
                                                          .plan = options.plan,
                                                          .sectors = options.sectors}));
  const MotorModel& motor = options.plan.motor;
  const auto rows = RowsOf(planned.plan, fleet.layout, fleet.drives, motor);
  if (!options.plot.empty()) {
    FOCALFLEET_TRY(WriteFileAtomically(options.plot, PlotOf(options, fleet, state, planned)));
  }
  // The plan is written last: where it exists, all files exist.
  FOCALFLEET_TRY(WriteFileAtomically(options.out, WritePlan(rows)));
  PlanEstimate estimate = Estimate(planned.plan, fleet.layout, fleet.drives, motor);
  PowerStatement power = StatePower(planned.plan, fleet.layout, fleet.drives, options.plan);
  StartVerdict starts = StartCheck(motor).Of(planned.plan, fleet);
  return Planned{std::move(fleet),    planned.targeted, std::move(planned.plan), planned.sectors,
                 std::move(estimate), std::move(power), std::move(starts),       rows.size()};
}

Json PairJson(const Layout& layout, PositionerIndex a, PositionerIndex b) {
  return Json::array({layout.unit(a).id.value, layout.unit(b).id.value});
}

/// The guarantees of the plan besides arrival.
Json GuaranteeJson(const Planned& planned, const PlanOptions& options) {
  const Layout& layout = planned.fleet.layout;
  Json tightest = Json::array();
  for (const TightPair& pair : planned.plan.tightest)
    tightest.push_back({{"unit_ids", PairJson(layout, pair.a, pair.b)},
                        {"clearance_um", 1e3 * pair.clearance_mm},
                        {"t_s", pair.t_s}});
  Json late = Json::array();
  for (const Unnoticed& pair : planned.plan.unnoticed)
    late.push_back({{"unit_ids", PairJson(layout, pair.ends, pair.follower)},
                    {"from_s", pair.at_s},
                    {"leaves_s", pair.leaves_s}});
  return {{"start_skew_s", options.start_skew_s},
          {"clock_error", options.clock_error},
          {"notice_s", options.notice_s},
          {"stages_s", planned.plan.stages_s},
          {"crossing_pairs", planned.plan.crossings},
          {"without_notice", late},
          {"tightest", tightest}};
}

const char* WordOf(Objective objective) {
  constexpr const char* kWords[] = {"soonest", "least_energy", "least_peak", "even_power"};
  return kWords[static_cast<std::size_t>(objective)];
}

/// The two units that set the bound of pairs; null: the slowest unit alone sets it.
Json PairBoundByJson(const Planned& planned) {
  if (!planned.plan.pair_bound_by) return nullptr;
  const auto id = [&](PositionerIndex unit) { return planned.fleet.layout.unit(unit).id.value; };
  return {id(planned.plan.pair_bound_by->first), id(planned.plan.pair_bound_by->second)};
}

Json Summary(const Planned& planned, const PlanCommandOptions& options) {
  Json rails = Json::array();
  for (const RailStatement& rail : planned.power.rails)
    rails.push_back({{"rail_id", rail.rail.value},
                     {"energy_J", rail.energy_J},
                     {"peak_power_W", rail.peak_W},
                     {"peak_power_most_W", rail.peak_most_W},
                     {"flatness", rail.flatness}});
  return {{"units", planned.fleet.layout.size()},
          {"targeted", planned.targeted},
          {"served", planned.targeted - planned.plan.unserved.size()},
          {"unserved", UnservedJson(planned.plan, planned.fleet.layout)},
          {"makespan_s", planned.estimate.makespan_s},
          {"bound_s", planned.plan.bound_s},
          {"pair_bound_s", planned.plan.pair_bound_s},
          {"pair_bound_by", PairBoundByJson(planned)},
          {"sectors", planned.sectors},
          {"guarantee", GuaranteeJson(planned, options.plan)},
          {"energy_J", planned.estimate.energy_J},
          {"peak_power_W", planned.estimate.peak_power_W},
          {"peak_power_most_W", planned.power.peak_most_W},
          {"flatness", planned.power.flatness},
          {"objective", WordOf(options.plan.objective)},
          {"rails", rails},
          {"below_critical", BelowCriticalJson(planned.starts)},
          {"rows", planned.rows},
          {"cpu_s", static_cast<double>(std::clock()) / CLOCKS_PER_SEC},
          {"out", options.out},
          {"plot", options.plot.empty() ? Json(nullptr) : Json(options.plot)}};
}

std::string DescribeGuarantee(const Json& guarantee) {
  std::string text;
  if (!guarantee["stages_s"].empty())
    text += fmt::format("\n  in {} stages; measure all units before {:.2f} s",
                        guarantee["stages_s"].size(),
                        fmt::join(guarantee["stages_s"].get<std::vector<double>>(), ", "));
  if (!guarantee["tightest"].empty()) {
    const Json& nearest = guarantee["tightest"].front();
    text += fmt::format(
        "\n  nearest: units {} and {} at {:.2f} s, {:.1f} um beyond the clearance or more",
        nearest["unit_ids"][0].get<std::uint32_t>(), nearest["unit_ids"][1].get<std::uint32_t>(),
        nearest["t_s"].get<double>(), nearest["clearance_um"].get<double>());
  }
  if (!guarantee["without_notice"].empty())
    text += fmt::format(
        "\n  a unit that ends early may be noticed too late in {} of {} crossing pairs",
        guarantee["without_notice"].size(), guarantee["crossing_pairs"].get<std::uint32_t>());
  return text;
}

std::string Describe(const Json& summary) {
  const auto number = [&](const char* key) { return summary[key].get<double>(); };
  const std::string text = fmt::format(
      "{}: {} of {} targets served, {} rows\n  makespan {:.2f} s (the slowest unit alone: {:.2f} "
      "s), "
      "energy {:.1f} J, peak power {:.1f} W (with skew and clocks {:.1f} W at most), flatness "
      "{:.2f}",
      summary["out"].get<std::string>(), summary["served"].get<std::uint64_t>(),
      summary["targeted"].get<std::uint64_t>(), summary["rows"].get<std::uint64_t>(),
      number("makespan_s"), number("bound_s"), number("energy_J"), number("peak_power_W"),
      number("peak_power_most_W"), number("flatness"));
  const Json& pair = summary["pair_bound_by"];
  const std::string together =
      pair.is_null() ? ""
                     : fmt::format("\n  units {} and {} need {:.2f} s at least, whatever others do",
                                   pair[0].get<std::uint32_t>(), pair[1].get<std::uint32_t>(),
                                   number("pair_bound_s"));
  const std::string plot =
      summary["plot"].is_null()
          ? ""
          : fmt::format("\n  {}: to look at, in a browser", summary["plot"].get<std::string>());
  const auto sectors = summary["sectors"].get<std::uint32_t>();
  const std::string parts =
      sectors > 1 ? fmt::format("\n  planned by {} sectors", sectors) : std::string();
  return text + together + parts + DescribeGuarantee(summary["guarantee"]) + plot +
         DescribeUnserved(summary["unserved"]);
}

ExitCode RunPlan(const Context& context, const PlanCommandOptions& options) {
  if (options.plan.within_s > 0 && options.plan.objective == Objective::kSoonest)
    return Report(context, {ErrorCode::kInvalid,
                            "--within-s goes with --least-energy, --least-peak or --even-power"});
  if (options.plan.stall_tolerant &&
      (options.sectors > 1 || options.plan.objective != Objective::kSoonest))
    return Report(context, {ErrorCode::kInvalid,
                            "--stall-tolerant goes with neither --sectors nor an objective"});
  if (options.plot == options.out)
    return Report(context, {ErrorCode::kInvalid,
                            fmt::format("{}: --out and --plot name one file", options.out)});
  const auto planned = MakeAndWrite(context, options);
  if (!planned) return Report(context, planned.error());
  const Json summary = Summary(*planned, options);
  if (context.json) PrintJson(summary);
  Say(context, Describe(summary) + DescribeBelowCritical(planned->starts));
  if (!planned->plan.unserved.empty()) NameUnserved(context, Describe(summary));
  return planned->plan.unserved.empty() ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

// Refuses stdout for the page: stdout carries the plan or its summary.
CLI::Validator NoStdout() {
  return {[](const std::string& path) {
            return path == "-" ? std::string("a page goes into a file") : std::string();
          },
          ""};
}

void AddObjectives(CLI::App* command, PlanCommandOptions* options) {
  struct Flag {
    const char* name;
    Objective objective;
    const char* what;
  };
  constexpr Flag kFlags[] = {
      {"--least-energy", Objective::kLeastEnergy, "Without detours, as far as the time allows"},
      {"--least-peak", Objective::kLeastPeak, "The largest peak of a supply rail as low as can be"},
      {"--even-power", Objective::kEvenPower, "Power of each rail as even as can be"}};
  std::vector<CLI::Option*> flags;
  for (const Flag& flag : kFlags) {
    const Objective objective = flag.objective;
    flags.push_back(command->add_flag_callback(
        flag.name, [options, objective] { options->plan.objective = objective; }, flag.what));
    for (CLI::Option* other : flags)
      if (other != flags.back()) flags.back()->excludes(other);
  }
  command
      ->add_option("--within-s", options->plan.within_s,
                   "All have arrived by then, s; with one of the three above "
                   "(default: the end of the soonest plan)")
      ->check(CLI::Range(0.001, 1677.0));
}

}  // namespace

void AddPlanCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "plan", "Plan a configuration on paper: what will move when",
                 "  focalfleet plan --units units.csv --targets targets.csv --from state.csv "
                 "--out plan.csv --plot plan.html");
  auto options = std::make_shared<PlanCommandOptions>();
  AddFleetFiles(command, &options->files);
  AddFile(command, "--targets", &options->targets, "targets.csv: where the fibres shall be")
      ->required();
  AddFile(command, "--from", &options->from, "state.csv: where every axis stands")->required();
  AddTunedStore(command, &options->store);
  command->add_flag("--fixed", options->plan.fixed,
                    "Units that no target names may not step aside");
  command
      ->add_option("--improve-cpu-s", options->plan.improve_cpu_s,
                   "Processor time for an earlier end on a dense plate, s")
      ->check(CLI::Range(0.0, 3600.0));
  command
      ->add_option("--rail-limit-w", options->plan.power.rail_W,
                   "No supply rail gives more at any instant, W")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--total-limit-w", options->plan.power.total_W, "Nor do all rails together, W")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--notice-s", options->plan.notice_s,
                   "Time to notice that a unit has stopped by itself, and to stop those that "
                   "follow it, s (default: 1)")
      ->check(CLI::Range(0.0, 60.0));
  command->add_flag("--stall-tolerant", options->plan.stall_tolerant,
                    "In stages, in which a unit that halts unseen touches nobody; all must be "
                    "measured in between");
  AddObjectives(command, options.get());
  command
      ->add_option("--sectors", options->sectors,
                   "Plan by this many strips of the plate, each with those around it (default: 1)")
      ->check(CLI::Range(1, 512));
  AddFile(command, "--out", &options->out, "plan.csv to write")->required();
  AddFile(command, "--plot", &options->plot,
          "plan.html to write: the plan to look at, in a browser; plan.svg: a small moving picture")
      ->check(NoStdout());
  OnChosen(line, command, options, RunPlan);
}

}  // namespace focalfleet::cli
