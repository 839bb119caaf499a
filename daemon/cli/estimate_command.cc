// The command estimate shows the time and power of moving to a configuration, for each wave mode
// side by side. Nothing moves, and no plan is written.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ctime>
#include <optional>
#include <utility>

#include "daemon/cli/command_line.h"
#include "daemon/cli/drive_options.h"
#include "daemon/cli/offline_fleet.h"
#include "daemon/cli/start_check.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "fleet/estimate.h"
#include "fleet/files/csv.h"
#include "fleet/targets.h"

namespace focalfleet::cli {
namespace {

constexpr unsigned kStartSubdivisionMax = 6144;

struct EstimateOptions {
  FleetFiles files;
  std::string targets;
  std::string from;  // empty: all arms folded
  bool fixed = false;
  std::string mode;   // empty: all
  UnitDrive drive;    // both axes as the first; for each unit that was not tuned in `store`
  std::string store;  // empty: none
  std::string model;  // empty: none
  std::string out;    // empty: none
};

struct ModeEstimate {
  WaveMode mode;
  EstimateFigures figures;
  StartVerdict starts;
};

struct Estimated {
  OfflineFleet fleet;
  OfflinePlan planned;
  std::optional<ModelInForce> model;
  EstimateSpread spread;
  std::vector<ModeEstimate> modes;
};

std::string CurveText(const std::vector<ModeEstimate>& modes) {
  CsvWriter csv({"t_s", "rail", "power_W", "mode"});
  const auto write = [&](const ModeEstimate& of, const std::string& rail,
                         const std::vector<PowerStep>& steps) {
    for (const PowerStep& step : steps) {
      csv.Number(step.t_s).Text(rail).Number(step.power_W).Text(Name(of.mode)).EndRow();
    }
  };
  for (const ModeEstimate& of : modes) {
    if (of.figures.stalls) continue;
    write(of, "total", of.figures.nominal.total);
    for (const RailCurve& rail : of.figures.nominal.rails) {
      write(of, std::to_string(rail.rail.value), rail.steps);
    }
  }
  return csv.Take();
}

std::string DescribeDrive(const UnitDrive& drive) {
  return fmt::format("{:g} V, {} counts x {}, {} vectors a turn", drive.v_bus_V,
                     drive.axis[0].counter1, drive.axis[0].repeat, drive.axis[0].subdivision);
}

Result<StatePoses> StartOf(const EstimateOptions& options, const OfflineFleet& fleet) {
  if (!options.from.empty()) return LoadState(options.from, fleet, WhoseState::kAll);
  const std::vector<Pose> folded = FoldedConfiguration(fleet.layout, fleet.drives);
  return StatePoses(folded.begin(), folded.end());
}

Result<std::optional<ModelInForce>> ModelOf(const EstimateOptions& options,
                                            const OfflineFleet& fleet) {
  if (options.model.empty()) return std::optional<ModelInForce>();
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(options.model));
  FOCALFLEET_TRY_ASSIGN(ModelInForce model, ReadModelInForce(text, options.model, fleet.layout));
  return std::optional(std::move(model));
}

Result<Estimated> MakeEstimate(const Context& context, const EstimateOptions& options) {
  FOCALFLEET_TRY_ASSIGN(OfflineFleet fleet, LoadFleet(context, options.files));
  UnitDrive drive = options.drive;
  drive.axis[1] = drive.axis[0];
  fleet.drives.assign(fleet.layout.size(), drive);
  FOCALFLEET_TRY(TakeTuned(options.store, &fleet));
  for (UnitDrive& tuned : fleet.drives) tuned.v_bus_V = drive.v_bus_V;
  FOCALFLEET_TRY_ASSIGN(const StatePoses start, StartOf(options, fleet));
  FOCALFLEET_TRY_ASSIGN(auto model, ModelOf(options, fleet));
  const std::string from = options.from.empty() ? "all arms folded" : options.from;
  FOCALFLEET_TRY_ASSIGN(OfflinePlan planned,
                        PlanOffline(context, fleet, start,
                                    {.targets = options.targets,
                                     .from = from,
                                     .plan = {.fixed = options.fixed},
                                     .compensation = model ? &model->compensation : nullptr}));
  Estimated estimated{std::move(fleet), std::move(planned), std::move(model), {}, {}};
  bool any_turns = false;
  bool any_starts = false;
  StartCheck check{MotorModel{}};
  for (const std::string& word : ModeWords()) {
    if (!options.mode.empty() && options.mode != word) continue;
    const WaveMode mode = ModeOf(word);
    for (UnitPlan& move : estimated.planned.plan.moves) move.mode = mode;
    estimated.modes.push_back(
        {mode,
         EstimateWithSpread(estimated.planned.plan, estimated.fleet.layout, estimated.fleet.drives,
                            MotorModel{}, estimated.spread),
         check.Of(estimated.planned.plan, estimated.fleet)});
    any_turns |= !estimated.modes.back().figures.stalls;
    any_starts |= !estimated.modes.back().starts.none_starts();
  }
  if (!any_turns) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("{}: the motor cannot pull its load ({:.2f} uNm) at this speed and "
                            "voltage; a higher --v-bus or --repeat is needed",
                            DescribeDrive(drive), MotorModel{}.load_torque_Nm * 1e6));
  }
  if (!any_starts) {
    // These motors would turn if they were brought up to speed, but they have to start from rest.
    const BelowCritical& first = estimated.modes.front().starts.below.front();
    return Fail(
        ErrorCode::kInvalid,
        fmt::format(
            "{}: no axis would start from rest: n {} is below the critical n{} of the load; "
            "a higher --v-bus or --repeat is needed",
            DescribeDrive(drive), first.repeat,
            first.critical > 0 ? fmt::format(" {}", first.critical) : ""));
  }
  if (!options.out.empty()) {
    FOCALFLEET_TRY(WriteFileAtomically(options.out, CurveText(estimated.modes)));
  }
  return estimated;
}

Json BandJson(const Banded& band) {
  return {{"value", band.nominal}, {"low", band.low}, {"high", band.high}};
}

Json PowerJson(const PowerFigures& power) {
  return {{"energy_J", BandJson(power.energy_J)},
          {"mean_power_W", BandJson(power.mean_power_W)},
          {"peak_power_W", BandJson(power.peak_power_W)}};
}

Json ModeJson(const ModeEstimate& of) {
  Json mode{{"mode", Name(of.mode)},
            {"stalls", of.figures.stalls},
            {"stalls_within_spread", of.figures.stalls_within_spread},
            {"axes", of.starts.axes},
            {"below_critical", BelowCriticalJson(of.starts)}};
  if (of.figures.stalls) return mode;
  mode.update(PowerJson(of.figures.total));
  mode["rails"] = Json::array();
  for (const RailFigures& rail : of.figures.rails) {
    Json one{{"rail_id", rail.rail.value}};
    one.update(PowerJson(rail.power));
    mode["rails"].push_back(one);
  }
  return mode;
}

Json ModelJson(const Estimated& estimated) {
  if (!estimated.model) return nullptr;
  Json beyond = Json::array();
  for (const PositionerIndex i : estimated.planned.beyond_range)
    beyond.push_back(estimated.fleet.layout.unit(i).id.value);
  return {{"name", estimated.model->file.model.name},
          {"compensated", estimated.planned.compensated},
          {"beyond_range", beyond},
          {"left_out", estimated.model->compensation.left_out()},
          {"too_near", estimated.planned.plan.too_near}};
}

Json Summary(const Estimated& estimated, const EstimateOptions& options) {
  const AxisDrive& drive = options.drive.axis[0];
  Json modes = Json::array();
  for (const ModeEstimate& of : estimated.modes) modes.push_back(ModeJson(of));
  const Plan& plan = estimated.planned.plan;
  return {{"units", estimated.fleet.layout.size()},
          {"targeted", estimated.planned.targeted},
          {"served", estimated.planned.served()},
          {"unserved", UnservedJson(plan, estimated.fleet.layout)},
          {"model", ModelJson(estimated)},
          {"v_bus_V", options.drive.v_bus_V},
          {"counter1", drive.counter1},
          {"repeat", drive.repeat},
          {"subdivision", drive.subdivision},
          {"makespan_s", BandJson(estimated.modes.front().figures.makespan_s)},
          {"modes", modes},
          {"spread",
           {{"load", estimated.spread.load},
            {"resistance", estimated.spread.resistance},
            {"model_error", estimated.spread.model_error}}},
          {"cpu_s", static_cast<double>(std::clock()) / CLOCKS_PER_SEC},
          {"out", options.out.empty() ? Json(nullptr) : Json(options.out)}};
}

std::string BandText(const Banded& band, int digits) {
  return fmt::format("{:.{}f} ({:.{}f} to {:.{}f})", band.nominal, digits, band.low, digits,
                     band.high, digits);
}

std::vector<std::string> RowOf(const std::string& name, const PowerFigures& power) {
  return {"  " + name, BandText(power.energy_J, 2), BandText(power.mean_power_W, 3),
          BandText(power.peak_power_W, 3)};
}

std::string DescribeMode(const ModeEstimate& of) {
  if (of.figures.stalls) {
    return fmt::format("\n{}: the motor cannot pull its load at this speed and voltage",
                       WordOf(of.mode));
  }
  std::vector<std::vector<std::string>> rows = {
      {WordOf(of.mode), "energy, J", "mean power, W", "peak power, W"},
      RowOf("total", of.figures.total)};
  for (const RailFigures& rail : of.figures.rails) {
    rows.push_back(RowOf(fmt::format("rail {}", rail.rail.value), rail.power));
  }
  std::string text = "\n" + AlignColumns(rows);
  if (of.figures.stalls_within_spread) {
    text += "\n  no margin: motors at the end of the spread cannot pull their load";
  }
  return text + DescribeBelowCritical(of.starts);
}

std::string DescribeModel(const Estimated& estimated) {
  if (!estimated.model) return "";
  const auto& left_out = estimated.model->compensation.left_out();
  return fmt::format("\n  {}: {} of {} targets compensated{}{}", estimated.model->file.model.name,
                     estimated.planned.compensated, estimated.planned.targeted,
                     left_out.empty() ? "" : "; not compensated: ", fmt::join(left_out, ", "));
}

std::string DescribeTooNear(const Estimated& estimated) {
  const std::string& too_near = estimated.planned.plan.too_near;
  return too_near.empty() ? "" : "\n  " + too_near + ": they may touch, and are led apart";
}

std::string DescribeBeyondRange(const Estimated& estimated) {
  std::string text;
  for (const PositionerIndex i : estimated.planned.beyond_range)
    text += fmt::format("\n  unit {}: by the model its range ends before the target",
                        estimated.fleet.layout.unit(i).id.value);
  return text;
}

std::string Describe(const Estimated& estimated, const EstimateOptions& options) {
  std::string text = fmt::format(
      "{}: {} of {} targets served\n  {}{}\n  makespan {} s", options.targets,
      estimated.planned.served(), estimated.planned.targeted, DescribeDrive(options.drive),
      DescribeModel(estimated), BandText(estimated.modes.front().figures.makespan_s, 2));
  for (const ModeEstimate& of : estimated.modes) text += DescribeMode(of);
  text += fmt::format(
      "\n(from low to high: load +-{:.0f} %, winding resistance +-{:.0f} %, all motors alike, and "
      "{:.0f} % of the model)",
      100 * estimated.spread.load, 100 * estimated.spread.resistance,
      100 * estimated.spread.model_error);
  return text + DescribeUnserved(UnservedJson(estimated.planned.plan, estimated.fleet.layout)) +
         DescribeBeyondRange(estimated) + DescribeTooNear(estimated);
}

ExitCode RunEstimate(const Context& context, const EstimateOptions& options) {
  const auto estimated = MakeEstimate(context, options);
  if (!estimated) return Report(context, estimated.error());
  if (context.json) PrintJson(Summary(*estimated, options));
  const std::string text = Describe(*estimated, options);
  Say(context, text);
  if (estimated->planned.served() == estimated->planned.targeted) return ExitCode::kOk;
  NameUnserved(context, text);
  return ExitCode::kSomeUnserved;
}

CLI::Validator MultipleOfSix() {
  return CLI::Validator(
      [](const std::string& text) {
        unsigned value = 0;
        if (CLI::detail::lexical_cast(text, value) && value > 0 && value <= kStartSubdivisionMax &&
            value % 6 == 0) {
          return std::string();
        }
        return fmt::format("{} is not a multiple of 6 up to {}: the field has six sectors", text,
                           kStartSubdivisionMax);
      },
      fmt::format("multiple of 6 up to {}", kSubdivisionMax));
}

}  // namespace

void AddEstimateCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "estimate", "What a configuration takes and draws, per wave mode",
                 "  focalfleet estimate --units units.csv --targets targets.csv\n"
                 "  focalfleet estimate --units units.csv --targets targets.csv --from state.csv "
                 "--mode asymmetric --v-bus 2.5 --out curve.csv --json");
  auto options = std::make_shared<EstimateOptions>();
  AddFleetFiles(command, &options->files);
  AddFile(command, "--targets", &options->targets, "targets.csv: where the fibres shall be")
      ->required();
  AddFile(command, "--from", &options->from,
          "state.csv: where every axis stands (default: all arms folded)");
  command->add_flag("--fixed", options->fixed, "Units that no target names may not step aside");
  OneOf(command->add_option("--mode", options->mode, "One wave mode (default: all, side by side)"),
        ModeWords());
  AddTunedStore(command, &options->store);
  AddFile(command, "--model", &options->model,
          "model.toml of a diagnosis: each unit is commanded to the count that, by this model, "
          "leads to its target");
  AxisDrive& axis = options->drive.axis[0];
  command->add_option("--v-bus", options->drive.v_bus_V, "Bus voltage, V")
      ->check(NumberBetween(0.1, kBridgeMax_V))
      ->capture_default_str();
  command->add_option("--counter1", axis.counter1, "Timer counts of a carrier period, V_counter1")
      ->check(CLI::Range(1, 65'535))
      ->capture_default_str();
  // The option uses a wider type: a byte would be read as a character.
  command
      ->add_option_function<unsigned>(
          "--repeat",
          [options](unsigned n) { options->drive.axis[0].repeat = static_cast<std::uint8_t>(n); },
          "Carrier periods of a vector, n")
      ->check(CLI::Range(1, 255))
      ->default_str(std::to_string(axis.repeat));
  command->add_option("--subdivision", axis.subdivision, "Vectors of an electrical turn")
      ->check(MultipleOfSix())
      ->capture_default_str();
  AddFile(command, "--out", &options->out, "curve.csv to write: power over time");
  OnChosen(line, command, options, RunEstimate);
}

}  // namespace focalfleet::cli
