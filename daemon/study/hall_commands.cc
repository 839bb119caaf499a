// The commands hall give the orientation of ball joints from Hall sensors. The command hall fit
// makes a model of a field map; hall orient turns voltages into orientations. The commands
// calibrate, diagnose and reproduce have files of their own.

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "daemon/access/sha256.h"
#include "daemon/cli/table.h"
#include "daemon/cli/table_input.h"
#include "daemon/files/text_file.h"
#include "daemon/study/hall_options.h"

namespace focalfleet::cli {
namespace {

using sim::FieldKind;
using sim::kRadPerDeg;

// ---- fit

struct HallFitOptions {
  std::string data;
  std::string out;
  std::string kind = "spherical";
};

FieldKind KindOf(const std::string& name) {
  for (const FieldKind kind : sim::kFieldKinds)
    if (sim::Name(kind) == name) return kind;
  return FieldKind::kSpherical;
}

Json ParametersJson(const sim::FieldParameters& parameters) {
  if (const auto* harmonic = std::get_if<sim::HarmonicParameters>(&parameters))
    return {{"amplitude_T", harmonic->amplitude_T},
            {"phase_deg", harmonic->phase_rad / kRadPerDeg},
            {"sd_amplitude_T", harmonic->sd_amplitude_T},
            {"sd_phase_deg", harmonic->sd_phase_rad / kRadPerDeg}};
  if (const auto* surface = std::get_if<sim::SurfaceParameters>(&parameters))
    return {{"amplitude_T", surface->amplitude_T},
            {"width_deg", surface->width_rad / kRadPerDeg},
            {"steepest_theta_deg", 90 - surface->width_rad / kRadPerDeg / std::sqrt(2.0)},
            {"phase_deg", surface->phase_rad / kRadPerDeg},
            {"sd_amplitude_T", surface->sd_amplitude_T},
            {"sd_width_deg", surface->sd_width_rad / kRadPerDeg},
            {"sd_phase_deg", surface->sd_phase_rad / kRadPerDeg}};
  return {{"terms", std::get<std::vector<sim::SphericalTerm>>(parameters).size()}};
}

// The number of points at which a sensor of +-0.1 T stands at the end of its range.
std::size_t Saturated(const sim::FieldMap& map) {
  const double range_T = sim::SensorElectronics{}.range_T();
  std::size_t count = 0;
  for (const sim::FieldPoint& point : map) count += std::abs(point.b_T) >= range_T ? 1u : 0u;
  return count;
}

ExitCode RunHallFit(const Context& context, const HallFitOptions& options) {
  const auto text = ReadTable(context, options.data, "b_T");
  if (!text) return Report(context, text.error());
  const auto map = ReadFieldMap(*text, options.data);
  if (!map) return Report(context, map.error());
  std::map<std::string, double> rms_T;
  std::optional<sim::FieldFit> chosen;
  for (const FieldKind kind : sim::kFieldKinds) {
    auto fit = sim::FitField(*map, kind);
    if (!fit) return Report(context, {fit.error().code, options.data + ": " + fit.error().text});
    rms_T[std::string(sim::Name(kind))] = fit->rms_T;
    if (kind == KindOf(options.kind)) chosen = std::move(*fit);
  }
  HallModelFile model{.name = options.kind,
                      .origin = options.data,
                      .sha256 = Sha256Hex(*text),
                      .field = chosen->parameters,
                      .radius_mm = chosen->radius_mm,
                      .peak_T = chosen->peak_T,
                      .rms_T = chosen->rms_T,
                      .noise_T = chosen->noise_T,
                      .decay = chosen->decay.value_or(0),
                      .decay_known = chosen->decay.has_value()};
  if (const auto written = WriteFileAtomically(options.out, WriteHallModel(model)); !written)
    return Report(context, written.error());
  const std::size_t saturated = Saturated(*map);
  if (context.json)
    PrintJson({{"kind", options.kind},
               {"points", map->size()},
               {"radius_mm", chosen->radius_mm},
               {"decay", chosen->decay ? Json(*chosen->decay) : Json(nullptr)},
               {"peak_T", chosen->peak_T},
               {"rms_T", chosen->rms_T},
               {"worst_T", chosen->worst_T},
               {"noise_T", chosen->noise_T},
               {"unlike_magnets", chosen->all_orders},
               {"parameters", ParametersJson(chosen->parameters)},
               {"rms_of_kinds_T", rms_T},
               {"saturated_points", saturated},
               {"out", options.out}});
  std::vector<std::vector<std::string>> rows = {{"model", "rms (mT)", "of the peak"}};
  for (const auto& [kind, residual_T] : rms_T)
    rows.push_back({kind, fmt::format("{:.4g}", residual_T * 1e3),
                    fmt::format("{:.3g} %", 100 * residual_T / chosen->peak_T)});
  Say(context, AlignColumns(rows));
  if (saturated > 0)
    Say(context,
        fmt::format("peak {:.4g} T: a sensor of 2.5 mV/G on 5 V ends at +-0.1 T, it saturates at "
                    "{:.3g} % of the points",
                    chosen->peak_T,
                    100.0 * static_cast<double>(saturated) / static_cast<double>(map->size())));
  Say(context, fmt::format("{}: {} model of {} points at {:g} mm, peak {:.4g} T, residual {:.3g} "
                           "mT rms, {:.3g} mT at worst{}",
                           options.out, options.kind, map->size(), chosen->radius_mm,
                           chosen->peak_T, chosen->rms_T * 1e3, chosen->worst_T * 1e3,
                           chosen->all_orders ? "; its magnets differ" : ""));
  return ExitCode::kOk;
}

// ---- orient

struct HallOrientOptions {
  std::string model;
  std::string data;
  std::string out;
  HallSensorOptions sensors;
  bool magnitudes = false;
  double tilt_max_deg = 45;
  double noise_mT = 0;
};

std::string NamesOf(const std::vector<std::size_t>& sensors, std::string_view between) {
  std::string names;
  for (const std::size_t sensor : sensors)
    names += fmt::format("{}v{}", names.empty() ? "" : between, sensor + 1);
  return names;
}

std::string Sentence(const sim::SensorVerdict& verdict) {
  if (!verdict.or_else.empty() && verdict.fault == sim::SensorFault::kSwapped)
    return fmt::format(
        "two sensors are swapped, cannot tell which: {}, or one of the pairs of {}; "
        "the orientations are those of the first",
        NamesOf(verdict.sensors, " and "), NamesOf(verdict.or_else, " "));
  if (!verdict.or_else.empty())
    return fmt::format("one sensor contradicts the others, cannot tell which: {} or {}",
                       NamesOf(verdict.sensors, " and "), NamesOf(verdict.or_else, " or "));
  const std::string sensor_names = NamesOf(verdict.sensors, " and ");
  switch (verdict.fault) {
    case sim::SensorFault::kMissing:
      return sensor_names + " is missing in every row";
    case sim::SensorFault::kStuck:
      return sensor_names + " is stuck: left out";
    case sim::SensorFault::kSwapped:
      return sensor_names + " are swapped: exchanged";
    case sim::SensorFault::kGain:
      return sensor_names + " is off in gain: left out";
    case sim::SensorFault::kOffset:
      return sensor_names + " is off by an offset: left out";
    case sim::SensorFault::kBad:
      return sensor_names + " contradicts the others, cannot tell how: left out";
  }
  return sensor_names;
}

Json VerdictsJson(const std::vector<sim::SensorVerdict>& verdicts) {
  Json list = Json::array();
  for (const sim::SensorVerdict& verdict : verdicts) {
    Json sensors = Json::array(), or_else = Json::array();
    for (const std::size_t sensor : verdict.sensors) sensors.push_back(sensor + 1);
    for (const std::size_t sensor : verdict.or_else) or_else.push_back(sensor + 1);
    list.push_back({{"fault", std::string(sim::Name(verdict.fault))},
                    {"sensors", sensors},
                    {"cannot_tell_from", or_else},
                    {"text", Sentence(verdict)}});
  }
  return list;
}

void ReportEstimates(const Context& context, const HallOrientOptions& options,
                     const sim::Estimates& estimates) {
  std::map<std::string, std::size_t> statuses;
  std::size_t solved = 0;
  for (const sim::RowEstimate& row : estimates.rows) {
    ++statuses[row.status];
    solved += row.solved ? 1u : 0u;
  }
  if (context.json)
    PrintJson({{"rows", estimates.rows.size()},
               {"solved", solved},
               {"statuses", statuses},
               {"sensors", VerdictsJson(estimates.verdicts)},
               {"noise_mT", estimates.noise_T * 1e3},
               {"noise_from_residuals", estimates.noise_from_residuals},
               {"beyond_supply", estimates.beyond_supply},
               {"out", options.out}});
  for (const sim::SensorVerdict& verdict : estimates.verdicts) Say(context, Sentence(verdict));
  if (estimates.beyond_supply)
    Say(context, "voltages outside 0..5 V: taken as they are, no sensor counts as saturated");
  if (options.magnitudes)
    Say(context,
        "the signs of the poles are lost: gamma and gamma +- 45 deg explain the same voltages");
  constexpr std::size_t kStatusesShown = 12;
  std::vector<std::vector<std::string>> rows = {{"status", "rows"}};
  for (const auto& [status, count] : statuses)
    if (rows.size() <= kStatusesShown) rows.push_back({status, std::to_string(count)});
  Say(context, AlignColumns(rows));
  Say(context, fmt::format("{}: {} of {} rows have an orientation; noise {:.3g} mT a sensor, {}",
                           options.out, solved, estimates.rows.size(), estimates.noise_T * 1e3,
                           estimates.noise_from_residuals ? "from the residuals" : "assumed"));
}

ExitCode RunHallOrient(const Context& context, const HallOrientOptions& options) {
  const auto model = LoadHallModel(options.model);
  if (!model) return Report(context, model.error());
  auto sensors = SensorsOf(options.sensors);
  if (!sensors) return Report(context, sensors.error());
  const auto text = ReadTable(context, options.data, "v1_V");
  if (!text) return Report(context, text.error());
  auto rig = RigOf(*model, std::move(*sensors));
  if (!rig) return Report(context, {rig.error().code, options.model + ": " + rig.error().text});
  const auto rows = ReadVoltages(*text, options.data, rig->sensors.size());
  if (!rows) return Report(context, rows.error());
  const std::shared_ptr<const sim::FieldModel> field = sim::MakeField(model->field);
  const sim::Estimates estimates =
      sim::EstimateOrientations(std::move(*rig), field, *rows,
                                {.magnitudes = options.magnitudes,
                                 .tilt_max_rad = options.tilt_max_deg * kRadPerDeg,
                                 .noise_T = options.noise_mT * 1e-3});
  if (const auto written = WriteFileAtomically(options.out, WriteEstimates(estimates)); !written)
    return Report(context, written.error());
  ReportEstimates(context, options, estimates);
  return ExitCode::kOk;
}

}  // namespace

void AddHallSensorOptions(CLI::App* command, HallSensorOptions* options) {
  AddFile(command, "--sensors", &options->sensors,
          "Directions of the sensors: sensor, x, y, z; gain, offset_V if any (default: the eight "
          "by their angles)");
  command
      ->add_option("--sensor-angles-deg", options->angles_deg,
                   "Of sensors 1, 2 from X, of 3, 4 from Z, of 5, 6 from Y (default: 11.25,75,15)")
      ->delimiter(',')
      ->expected(3)
      ->check(NumberBetween(0, 90))
      ->type_name("DEG");
}

Result<std::vector<sim::HallSensor>> SensorsOf(const HallSensorOptions& options) {
  if (!options.sensors.empty()) {
    if (!options.angles_deg.empty())
      return Fail(ErrorCode::kInvalid, "--sensors and --sensor-angles-deg say different things");
    FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(options.sensors, "sensor"));
    return ReadSensors(text, options.sensors);
  }
  sim::SensorAngles angles;
  if (!options.angles_deg.empty())
    angles = {options.angles_deg[0] * kRadPerDeg, options.angles_deg[1] * kRadPerDeg,
              options.angles_deg[2] * kRadPerDeg};
  return sim::EightSensors(angles);
}

Result<HallModelFile> LoadHallModel(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(path));
  return ReadHallModel(text, path);
}

void AddHallFit(CommandLine* line, CLI::App* hall) {
  CLI::App* command =
      AddCommand(hall, "fit", "Fit a model to a map of a rotor's radial field",
                 "  focalfleet hall fit --data field.csv --out model.toml\n"
                 "  focalfleet hall fit --data field.csv --kind surface --out surface.toml");
  auto options = std::make_shared<HallFitOptions>();
  AddFile(command, "--data", &options->data, "The map: theta_deg, phi_deg, b_T")->required();
  AddFile(command, "--out", &options->out, "The model, or - for stdout")->required();
  OneOf(command->add_option("--kind", options->kind, "Which model"),
        {"spherical", "surface", "harmonic"})
      ->capture_default_str();
  OnChosen(line, command, options, RunHallFit);
}

void AddHallOrient(CommandLine* line, CLI::App* hall) {
  CLI::App* command = AddCommand(
      hall, "orient", "Orientations from the voltages of Hall sensors, with their uncertainty",
      "  focalfleet hall orient --model model.toml --data volts.csv --out est.csv\n"
      "  focalfleet hall orient --model model.toml --sensors sensors.csv --data volts.csv --out -");
  auto options = std::make_shared<HallOrientOptions>();
  AddFile(command, "--model", &options->model, "The model, from `hall fit` or `hall diagnose`")
      ->required();
  AddFile(command, "--data", &options->data, "Voltages: v1_V, v2_V, ...; temp_C if any")
      ->required();
  AddFile(command, "--out", &options->out, "The orientations, or - for stdout")->required();
  AddHallSensorOptions(command, &options->sensors);
  command->add_flag("--magnitudes", options->magnitudes,
                    "The voltages are |V - Vs/2|: the signs of the poles are lost");
  command
      ->add_option("--tilt-max-deg", options->tilt_max_deg,
                   "Greatest alpha and beta that are looked for")
      ->check(NumberBetween(1, 60))
      ->capture_default_str();
  command
      ->add_option("--noise-mt", options->noise_mT,
                   "Noise of a sensor in mT (default: from the residuals of 20 rows or more, else "
                   "0.5)")
      ->check(NumberBetween(1e-6, 100));
  OnChosen(line, command, options, RunHallOrient);
}

void AddHallCommands(CommandLine* line) {
  CLI::App* hall = AddCommand(
      &line->app, "hall", "Orientation of ball joints without an encoder, from Hall sensors",
      "  focalfleet hall fit --data field.csv --out model.toml\n"
      "  focalfleet hall orient --model model.toml --data volts.csv --out est.csv");
  hall->require_subcommand(1);
  AddHallFit(line, hall);
  AddHallOrient(line, hall);
  AddHallCalibrate(line, hall);
  AddHallDiagnose(line, hall);
  AddHallReproduce(line, hall);
}

}  // namespace focalfleet::cli
