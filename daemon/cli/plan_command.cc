// plan: from a state to targets, on paper. Nothing moves; anyone can check the file that it writes.

#include <fmt/format.h>

#include <ctime>

#include "daemon/cli/command_line.h"
#include "daemon/cli/offline_fleet.h"
#include "daemon/cli/text_file.h"
#include "fleet/estimate.h"
#include "fleet/files/plan_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/plan/planner.h"
#include "fleet/targets.h"

namespace focalfleet::cli {
namespace {

struct PlanCommandOptions {
  FleetFiles files;
  std::string targets;
  std::string from;
  bool fixed = false;
  std::string out;
};

struct Planned {
  OfflineFleet fleet;
  std::size_t targeted = 0;
  Plan plan;
  PlanEstimate estimate;
  std::size_t rows = 0;
};

std::vector<UnitKnowledge> KnowledgeOf(const std::vector<std::optional<Pose>>& state) {
  std::vector<UnitKnowledge> knowledge(state.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state[i]) knowledge[i] = Exactly(Witness::kReported, *state[i]);
  }
  return knowledge;
}

Result<Planned> MakeAndWrite(const Context& context, const PlanCommandOptions& options) {
  FOCALFLEET_TRY_ASSIGN(OfflineFleet fleet, LoadFleet(context, options.files));
  FOCALFLEET_TRY_ASSIGN(const auto state, LoadState(options.from, fleet));
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(options.targets));
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(text, options.targets));
  const std::vector<UnitKnowledge> start = KnowledgeOf(state);
  FOCALFLEET_TRY_ASSIGN(const auto poses,
                        ResolveTargets(targets, fleet.layout, fleet.drives, start));
  std::vector<std::uint8_t> frozen(fleet.layout.size());
  for (std::uint32_t i = 0; i < frozen.size(); ++i) {
    frozen[i] = fleet.layout.unit({i}).enabled ? 0 : 1;
  }
  auto plan = MakePlan({.layout = &fleet.layout,
                        .drives = fleet.drives,
                        .start = start,
                        .targets = poses,
                        .frozen = frozen},
                       {.fixed = options.fixed});
  if (!plan) {
    return Fail(plan.error().code,
                fmt::format("{} from {}: {}", options.targets, options.from, plan.error().text));
  }
  const MotorModel motor;
  const auto rows = RowsOf(*plan, fleet.layout, fleet.drives, motor);
  FOCALFLEET_TRY(WriteFileAtomically(options.out, WritePlan(rows)));
  PlanEstimate estimate = Estimate(*plan, fleet.layout, fleet.drives, motor);
  return Planned{std::move(fleet), targets.rows.size(), std::move(*plan), std::move(estimate),
                 rows.size()};
}

double Peak(const RailCurve& curve) {
  double peak = 0;
  for (const PowerStep& step : curve.steps) peak = std::max(peak, step.power_W);
  return peak;
}

Json UnservedJson(const Planned& planned) {
  Json rows = Json::array();
  for (const Unserved& unserved : planned.plan.unserved) {
    Json by = nullptr;
    if (unserved.by) by = planned.fleet.layout.unit(*unserved.by).id.value;
    rows.push_back({{"unit_id", planned.fleet.layout.unit(unserved.unit).id.value},
                    {"why", Name(unserved.why)},
                    {"by", by}});
  }
  return rows;
}

Json Summary(const Planned& planned, const PlanCommandOptions& options) {
  Json rails = Json::array();
  for (const RailCurve& curve : planned.estimate.rails) {
    rails.push_back({{"rail_id", curve.rail.value}, {"peak_power_W", Peak(curve)}});
  }
  return {{"units", planned.fleet.layout.size()},
          {"targeted", planned.targeted},
          {"served", planned.targeted - planned.plan.unserved.size()},
          {"unserved", UnservedJson(planned)},
          {"makespan_s", planned.estimate.makespan_s},
          {"energy_J", planned.estimate.energy_J},
          {"peak_power_W", planned.estimate.peak_power_W},
          {"rails", rails},
          {"rows", planned.rows},
          {"cpu_s", static_cast<double>(std::clock()) / CLOCKS_PER_SEC},
          {"out", options.out}};
}

std::string Describe(const Json& summary) {
  const auto number = [&](const char* key) { return summary[key].get<double>(); };
  std::string text = fmt::format(
      "{}: {} of {} targets served, {} rows\n  makespan {:.1f} s, energy {:.1f} J, peak power "
      "{:.1f} W",
      summary["out"].get<std::string>(), summary["served"].get<std::uint64_t>(),
      summary["targeted"].get<std::uint64_t>(), summary["rows"].get<std::uint64_t>(),
      number("makespan_s"), number("energy_J"), number("peak_power_W"));
  for (const Json& unserved : summary["unserved"]) {
    text += fmt::format("\n  unit {}: {}", unserved["unit_id"].get<std::uint32_t>(),
                        unserved["why"].get<std::string>());
    if (!unserved["by"].is_null()) {
      text += fmt::format(" (unit {})", unserved["by"].get<std::uint32_t>());
    }
  }
  return text;
}

ExitCode RunPlan(const Context& context, const PlanCommandOptions& options) {
  const auto planned = MakeAndWrite(context, options);
  if (!planned) return Report(context, planned.error());
  const Json summary = Summary(*planned, options);
  if (context.json) PrintJson(summary);
  Say(context, Describe(summary));
  if (!planned->plan.unserved.empty()) NameUnserved(context, Describe(summary));
  return planned->plan.unserved.empty() ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

}  // namespace

void AddPlanCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "plan", "Plan a configuration on paper: what will move when",
                 "  focalfleet plan --units units.csv --targets targets.csv --from state.csv "
                 "--out plan.csv --json");
  auto options = std::make_shared<PlanCommandOptions>();
  AddFleetFiles(command, &options->files);
  AddFile(command, "--targets", &options->targets, "targets.csv: where the fibres shall be")
      ->required();
  AddFile(command, "--from", &options->from, "state.csv: where every axis stands")->required();
  command->add_flag("--fixed", options->fixed, "Units that no target names may not step aside");
  AddFile(command, "--out", &options->out, "plan.csv to write")->required();
  OnChosen(line, command, options, RunPlan);
}

}  // namespace focalfleet::cli
