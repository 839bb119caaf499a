// The command tune finds the repeat n that a motor needs, by its own load and always from rest:
// of a single motor, or of a fleet into the store.

#include <fmt/format.h>

#include <memory>

#include "daemon/cli/drive_options.h"
#include "daemon/study/study.h"
#include "daemon/study/tune.h"

namespace focalfleet::cli {

std::vector<DriveChoice> ChoicesOf(const TuneOptions& options, const DriveChoice& given) {
  if (options.minimise.empty()) return {given};
  std::vector<DriveChoice> choices;
  std::vector<double> rails = options.rails_V;
  if (rails.empty()) rails.push_back(options.drive.v_bus_V);
  for (const double v_bus_V : rails)
    for (const std::string& mode : ModeWords()) {
      DriveChoice choice = given;
      choice.setting.bridge.v_bus_V = v_bus_V;
      choice.modulation.mode = ModeOf(mode);
      choices.push_back(choice);
    }
  return choices;
}

std::string Because(sim::TuningOutcome outcome, double peak_share, double share_max) {
  switch (outcome) {
    case sim::TuningOutcome::kTuned:
      return "";
    case sim::TuningOutcome::kStalls:
      return "the load stalls from rest with every n up to 255";
    case sim::TuningOutcome::kNoMargin:
      return "no n up to 255 starts the load with the margin";
    case sim::TuningOutcome::kPeak:
      return fmt::format("the current reaches {:.1f} % of 2V/(3r), more than {:.1f} %",
                         peak_share * 100, share_max * 100);
  }
  return "";
}

namespace {

ExitCode RunTune(const Context& context, const TuneOptions& given) {
  TuneOptions options = given;
  options.rule.ramp.stage_s = options.ramp_stage_ms * 1e-3;
  const auto choice = ChoiceOf(options.drive);
  if (!choice) return Report(context, choice.error());
  const bool fleet = !options.units.empty();
  const bool for_fleet = !options.loads.empty() || !options.store.empty() || !options.out.empty();
  if (!fleet && for_fleet) {
    return Report(context, {ErrorCode::kInvalid, "--loads, --store and --out need --units"});
  }
  if (fleet && options.store.empty() && options.out.empty()) {
    return Report(context, {ErrorCode::kInvalid, "a fleet's tuning goes to --store or --out"});
  }
  if (fleet && options.rule.ramp.stages > 0) {
    return Report(context, {ErrorCode::kInvalid,
                            "--ramp-stages is for one motor; units start their moves without"});
  }
  if (!options.rails_V.empty() && options.minimise.empty()) {
    return Report(context, {ErrorCode::kInvalid, "--rails are what --minimise chooses from"});
  }
  if (fleet && choice->setting.motor.load_Nm <= 0) {
    return Report(context, {ErrorCode::kInvalid, "--load 0: nothing is to be tuned"});
  }
  return fleet ? TuneFleet(context, options, *choice) : TuneOne(context, options, *choice);
}

void AddRuleOptions(CLI::App* command, TuneOptions* options) {
  sim::TuningRule& rule = options->rule;
  command
      ->add_option("--margin", rule.margin, "Load that n shall start, beyond its own, as a share")
      ->check(NumberBetween(0, 10))
      ->capture_default_str();
  command
      ->add_option("--peak-share", rule.peak_share,
                   "Of 2V/(3r), that no phase current may exceed, turning or blocked")
      ->check(PositiveNumberUpTo(1))
      ->capture_default_str();
  command->add_option("--move-deg", rule.move_deg, "Move for which time and energy are reported")
      ->check(PositiveNumberUpTo(3600))
      ->capture_default_str();
  command->add_option("--ramp-stages", rule.ramp.stages, "Stages of a start")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  command->add_option("--ramp-stage-ms", options->ramp_stage_ms, "How long a stage lasts")
      ->check(PositiveNumberUpTo(1e4))
      ->capture_default_str();
  command
      ->add_option("--winding-K-per-W", rule.winding_K_per_W,
                   "Winding above ambient for a watt of copper losses (default: it stays at 20 C)")
      ->check(PositiveNumberUpTo(1e4));
  command->add_option("--ambient-C", rule.ambient_C, "Where the motor stands")
      ->check(NumberBetween(-50, 100))
      ->capture_default_str();
  OneOf(command->add_option("--minimise", options->minimise,
                            "Choose bus voltage, mode and ramp for this; of a fleet the voltage of "
                            "each rail and the mode of each unit"),
        {"energy", "time"});
  command->add_option("--rails", options->rails_V, "Bus voltages to choose from (default: --v-bus)")
      ->delimiter(',')
      ->check(PositiveNumberUpTo(kBridgeMax_V, " V, which the bridge bears"));
}

void AddFleetOptions(CLI::App* command, TuneOptions* options) {
  AddFile(command, "--units", &options->units, "units.csv: tune both axes of every unit");
  AddFile(command, "--loads", &options->loads,
          "loads.csv: unit_id, axis, load_uNm (default: --load for all)");
  command
      ->add_option("--load-spread", options->load_spread,
                   "Standard deviation of the loads that no file gives, as a share")
      ->check(NumberBetween(0, 1))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Same seed, same loads")->capture_default_str();
  command->add_flag("--full", options->full, "Try every n of a fleet at PWM level, too");
  AddFile(command, "--store", &options->store, "The daemon's store, while no daemon has it");
  AddFile(command, "--out", &options->out, "tuned.csv to write");
}

}  // namespace

void AddTuneCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "tune", "Find the n that motors need, always from rest",
      "  focalfleet tune --v-bus 1.8 --margin 0.5\n"
      "  focalfleet tune --minimise energy --rails 1.8,2.5,3.3 --ramp-stages 4\n"
      "  focalfleet tune --units units.csv --load-spread 0.1 --store /var/lib/focalfleet/fleet.db");
  auto options = std::make_shared<TuneOptions>();
  options->drive.load = "fleet";
  AddBridgeOptions(command, &options->drive);
  AddMotorOptions(command, &options->drive);
  AddRuleOptions(command, options.get());
  AddFleetOptions(command, options.get());
  OnChosen(line, command, options, RunTune);
}

}  // namespace focalfleet::cli
