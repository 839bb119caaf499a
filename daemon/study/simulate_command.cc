// The commands simulate run the physics without any unit or fleet. simulate drive runs one motor on
// its bridge, at PWM level.

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "daemon/cli/drive_options.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/study/drive_report.h"
#include "daemon/study/study.h"
#include "fleet/files/csv.h"
#include "sim/drive/scope/recording.h"
#include "sim/drive/start_study.h"

namespace focalfleet::cli {
namespace {

// The limit keeps wave.csv below the size of a file that this program reads, and a run below some
// minutes.
constexpr double kSamplesMax = 2e6;
constexpr double kCarriersMax = 3e7;

struct SimulateDriveOptions {
  DriveOptions drive;
  int turns = 2;
  bool from_rest = false;
  sim::Ramp ramp;
  double ramp_stage_ms = 10;
  double sample_ns = 0;  // 0: by the carrier period
  std::string out;
};

struct Simulated {
  DriveChoice choice;
  sim::RecordingPlan plan;
  sim::Recording recording;
  bool starts_from_rest = false;
};

Result<sim::RecordingPlan> PlanOf(const SimulateDriveOptions& options, const DriveChoice& choice) {
  sim::RecordingPlan plan{.turns = options.turns,
                          .from_rest = options.from_rest,
                          .ramp = {options.ramp.stages, options.ramp_stage_ms * 1e-3},
                          .sample_s = options.sample_ns * 1e-9};
  if (plan.ramp.stages > 0 && !plan.from_rest) {
    return Fail(ErrorCode::kInvalid, "--ramp-stages belongs to a start: give --from-rest, too");
  }
  if (plan.sample_s > choice.modulation.carrier_s() / 4) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("--sample-ns {:g}: a carrier period of {:g} ns needs four samples",
                            options.sample_ns, choice.modulation.carrier_s() * 1e9));
  }
  const sim::RecordingSize size = SizeOf(choice.modulation, plan);
  if (size.samples > kSamplesMax || size.carriers > kCarriersMax) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("{:.0f} samples of {:.0f} carrier periods are more than {:.0f} of "
                            "{:.0f}: fewer --turns, shorter ramps or a longer --sample-ns",
                            size.samples, size.carriers, kSamplesMax, kCarriersMax));
  }
  return plan;
}

// The value rounded to its meaningful digits, which prints short.
double Rounded(double value, double per_unit) { return std::round(value * per_unit) / per_unit; }

std::string WaveText(const sim::Recording& recording) {
  CsvWriter csv({"t_s", "ia_A", "ib_A", "ic_A", "va_V", "vb_V", "vc_V", "torque_Nm", "theta_rad"});
  for (const sim::DriveSample& sample : recording.samples) {
    csv.Number(Rounded(sample.t_s, 1e13));
    for (const double current : sample.current_A) csv.Number(Rounded(current, 1e9));
    for (const double voltage : sample.voltage_V) csv.Number(Rounded(voltage, 1e6));
    csv.Number(Rounded(sample.torque_Nm, 1e14)).Number(Rounded(sample.angle_rad, 1e9));
    csv.EndRow();
  }
  return csv.Take();
}

const char* Verdict(const Simulated& simulated) {
  if (simulated.recording.in_step) return "in step";
  return simulated.plan.from_rest
             ? "stalled: the rotor does not follow the field from rest"
             : "stalled: at no lag the motor has the torque that the load and the drag need";
}

Json Summary(const Simulated& simulated, const SimulateDriveOptions& options) {
  const sim::Recording& recording = simulated.recording;
  const sim::WaveFigures& figures = recording.figures;
  const CurrentLimits limits = LimitsOf(simulated.choice.setting);
  const double time_s = static_cast<double>(recording.samples.size()) * recording.sample_s;
  Json settings = SettingsJson(options.drive, simulated.choice);
  settings.update({{"turns", options.turns},
                   {"from_rest", options.from_rest},
                   {"ramp_stages", options.ramp.stages},
                   {"ramp_stage_ms", options.ramp_stage_ms},
                   {"sample_ns", recording.sample_s * 1e9}});
  Json lag = nullptr;
  if (recording.in_step) lag = recording.lag_rad * 180 / std::numbers::pi;
  return {
      {"in_step", recording.in_step},
      {"verdict", Verdict(simulated)},
      {"starts_from_rest", simulated.starts_from_rest},
      {"peak_A", figures.peak_A},
      {"rms_A", figures.rms_A},
      {"fundamental_A", figures.fundamental_A},
      {"snr_dB", figures.snr_dB},
      {"thd", figures.thd},
      {"limit_linear_A", limits.linear_A},
      {"limit_reachable_A", limits.reachable_A},
      {"torque_mean_Nm", figures.torque_mean_Nm},
      {"torque_ripple",
       {{"rms", figures.torque_ripple_rms}, {"peak_to_peak", figures.torque_ripple_peak_to_peak}}},
      {"power_W",
       {{"supply", figures.power.supply_W},
        {"copper", figures.power.copper_W},
        {"switching", figures.power.switching_W},
        {"mechanical", figures.power.mechanical_W},
        {"stored", recording.spent.stored_J / time_s}}},
      {"supply_A", figures.supply_A},
      {"edges_per_carrier", figures.edges_per_carrier},
      {"energy_balance", recording.energy_balance()},
      {"lag_deg", lag},
      {"speed_rpm", recording.speed_rad_per_s * 30 / std::numbers::pi},
      {"field_rpm", simulated.choice.modulation.field_Hz() * 60},
      {"samples", recording.samples.size()},
      {"time_s", time_s},
      {"settings", settings}};
}

TextRows RowsOf(const Json& object) {
  TextRows rows;
  for (const auto& [name, value] : object.items()) {
    if (name == "settings") continue;
    if (value.is_object()) {
      for (const auto& [inner, number] : value.items())
        rows.push_back({name + "." + inner, fmt::format("{:.6g}", number.get<double>())});
    } else if (value.is_number_float()) {
      rows.push_back({name, fmt::format("{:.6g}", value.get<double>())});
    } else {
      rows.push_back({name, value.is_string() ? value.get<std::string>() : value.dump()});
    }
  }
  return rows;
}

Result<Simulated> Simulate(const SimulateDriveOptions& options) {
  Simulated simulated;
  FOCALFLEET_TRY_ASSIGN(simulated.choice, ChoiceOf(options.drive));
  FOCALFLEET_TRY_ASSIGN(simulated.plan, PlanOf(options, simulated.choice));
  const auto& [setting, modulation] = simulated.choice;
  simulated.recording = Record(setting, modulation, simulated.plan);
  simulated.starts_from_rest =
      simulated.plan.from_rest
          ? simulated.recording.in_step
          : StartsAtWorstLoad(setting, modulation, {}, sim::DriveLevel::kReduced);
  return simulated;
}

Status WriteAll(const SimulateDriveOptions& options, const Simulated& simulated,
                const Json& summary) {
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return Fail(ErrorCode::kUnavailable,
                fmt::format("{}: no such directory can be made: {}", options.out, error.message()));
  }
  FOCALFLEET_TRY(WriteFileAtomically(options.out + "/wave.csv", WaveText(simulated.recording)));
  FOCALFLEET_TRY(WriteFileAtomically(options.out + "/report.html",
                                     DriveReport(simulated.choice, simulated.recording,
                                                 RowsOf(summary), RowsOf(summary["settings"]))));
  // summary.json is written last: where it exists, all files exist.
  return WriteFileAtomically(options.out + "/summary.json",
                             summary.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::string Describe(const Simulated& simulated, const SimulateDriveOptions& options) {
  const sim::Recording& recording = simulated.recording;
  const sim::WaveFigures& figures = recording.figures;
  std::string text = Verdict(simulated);
  if (recording.in_step) {
    text += fmt::format(", {:.1f} rpm, lag {:.2f} degrees",
                        recording.speed_rad_per_s * 30 / std::numbers::pi,
                        recording.lag_rad * 180 / std::numbers::pi);
    if (!simulated.starts_from_rest) text += "; but from rest it would not start";
  }
  const auto& power = figures.power;
  text += fmt::format(
      "\n{}",
      AlignColumns(
          {{"phase current, mA",
            fmt::format("peak {:.2f}, rms {:.2f}, fundamental {:.2f}", figures.peak_A * 1e3,
                        figures.rms_A * 1e3, figures.fundamental_A * 1e3)},
           {"SNR, dB", fmt::format("{:.2f} (thd {:.4f})", figures.snr_dB, figures.thd)},
           {"torque, uNm",
            fmt::format("{:.3f}, ripple {:.1f} % rms, {:.1f} % peak to peak",
                        figures.torque_mean_Nm * 1e6, figures.torque_ripple_rms * 100,
                        figures.torque_ripple_peak_to_peak * 100)},
           {"power, mW",
            fmt::format("{:.2f} = copper {:.2f} + switching {:.2f} + mechanical {:.2f} + stored",
                        power.supply_W * 1e3, power.copper_W * 1e3, power.switching_W * 1e3,
                        power.mechanical_W * 1e3)},
           {"supply, mA", fmt::format("{:.2f}", figures.supply_A * 1e3)},
           {"written", options.out + "/{wave.csv, summary.json, report.html}"}}));
  return text;
}

ExitCode RunSimulateDrive(const Context& context, const SimulateDriveOptions& options) {
  const auto simulated = Simulate(options);
  if (!simulated) return Report(context, simulated.error());
  Json summary = Summary(*simulated, options);
  if (const auto written = WriteAll(options, *simulated, summary); !written) {
    return Report(context, written.error());
  }
  if (context.json) {
    summary["out"] = options.out;
    PrintJson(summary);
  }
  Say(context, Describe(*simulated, options));
  return ExitCode::kOk;
}

void AddDrive(CLI::App* parent, CommandLine* line) {
  CLI::App* command = AddCommand(
      parent, "drive", "One motor on its bridge, exact between switching edges",
      "  focalfleet simulate drive --v-bus 9 --counter1 500 --repeat 8 --subdivision 96 --mode "
      "asymmetric --out wave\n"
      "  focalfleet simulate drive --repeat 36 --load fleet --from-rest --out stall");
  auto options = std::make_shared<SimulateDriveOptions>();
  AddBridgeOptions(command, &options->drive);
  AddRepeatOption(command, &options->drive);
  AddMotorOptions(command, &options->drive);
  command->add_option("--turns", options->turns, "Turns of the field to sample")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_flag("--from-rest", options->from_rest,
                    "Begin at rest, at the place of the highest load (default: in step)");
  command
      ->add_option("--ramp-stages", options->ramp.stages,
                   "Stages of a start, each faster than the one before")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  command->add_option("--ramp-stage-ms", options->ramp_stage_ms, "How long a stage lasts")
      ->check(PositiveNumberUpTo(1e4))
      ->capture_default_str();
  command
      ->add_option("--sample-ns", options->sample_ns,
                   "Between two rows of wave.csv (default: 1/32 of a carrier period or less)")
      ->check(NumberBetween(1, 1e6));
  command->add_option("--out", options->out, "Directory for wave.csv, summary.json, report.html")
      ->type_name("FILE")
      ->required();
  OnChosen(line, command, options, RunSimulateDrive);
}

}  // namespace

void AddSimulateCommand(CommandLine* line) {
  CLI::App* simulate =
      line->app.add_subcommand("simulate", "Simulate a motor or a measured campaign, no fleet");
  simulate->require_subcommand(1);
  AddDrive(simulate, line);
  AddSimulateCampaign(simulate, line);
}

}  // namespace focalfleet::cli
