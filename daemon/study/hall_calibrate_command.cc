// The command hall calibrate finds gain, offset and position of each sensor, from known poses and a
// known field.

#include <fmt/format.h>

#include <cmath>

#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/study/hall_options.h"
#include "sim/hall/diagnosis/calibration.h"

namespace focalfleet::cli {
namespace {

using sim::CalibrationStatus;
using sim::kRadPerDeg;
using sim::SensorFit;

struct HallCalibrateOptions {
  std::string model;
  std::string data;
  std::string out;
  HallSensorOptions sensors;
};

Result<HallModelFile> LoadFieldAlone(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(HallModelFile model, LoadHallModel(path));
  if (model.sensors.empty()) return model;
  return Fail(ErrorCode::kInvalid,
              path +
                  ": has [[sensor]], what sensors are off by, already; calibrate by a model of "
                  "the field alone, as `hall fit` writes it");
}

Json SensorJson(const SensorFit& fit, std::size_t number) {
  const bool ok = fit.status == CalibrationStatus::kOk;
  const auto known = [&](double value) { return ok ? Json(value) : Json(nullptr); };
  const sim::Vector3& at = fit.sensor.direction;
  return {{"sensor", number},
          {"status", sim::Name(fit.status)},
          {"direction", {at.x, at.y, at.z}},
          {"gain", known(fit.sensor.gain)},
          {"sd_gain", known(fit.sd_gain)},
          {"offset_V", known(fit.sensor.offset_V)},
          {"sd_offset_V", known(fit.sd_offset_V)},
          {"east_deg", known(fit.shift.east_rad / kRadPerDeg)},
          {"sd_east_deg", known(fit.sd_east_rad / kRadPerDeg)},
          {"north_deg", known(fit.shift.north_rad / kRadPerDeg)},
          {"sd_north_deg", known(fit.sd_north_rad / kRadPerDeg)},
          {"readings", fit.readings},
          {"left_out",
           {{"missing", fit.missing}, {"saturated", fit.saturated}, {"far off", fit.far_off}}},
          {"rms_before_mV", fit.rms_before_V * 1e3},
          {"rms_after_mV", fit.rms_after_V * 1e3},
          {"rms_held_out_mV", known(fit.rms_held_out_V * 1e3)}};
}

std::string WithDeviation(double value, double sd) {
  return fmt::format("{:.4g} +- {:.1g}", value, sd);
}

std::string SensorTable(const std::vector<SensorFit>& fits) {
  std::vector<std::vector<std::string>> rows = {{"sensor", "gain", "offset (mV)", "east (deg)",
                                                 "north (deg)", "readings", "rms (mV)", "status"}};
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const SensorFit& fit = fits[k];
    rows.push_back({fmt::format("v{}", k + 1), "-", "-", "-", "-", std::to_string(fit.readings),
                    fmt::format("{:.3g} -> {:.3g}", fit.rms_before_V * 1e3, fit.rms_after_V * 1e3),
                    sim::Name(fit.status)});
    if (fit.status != CalibrationStatus::kOk) continue;
    rows.back()[1] = fmt::format("{:.5f} +- {:.5f}", fit.sensor.gain, fit.sd_gain);
    rows.back()[2] = WithDeviation(fit.sensor.offset_V * 1e3, fit.sd_offset_V * 1e3);
    rows.back()[3] = WithDeviation(fit.shift.east_rad / kRadPerDeg, fit.sd_east_rad / kRadPerDeg);
    rows.back()[4] = WithDeviation(fit.shift.north_rad / kRadPerDeg, fit.sd_north_rad / kRadPerDeg);
  }
  return AlignColumns(rows);
}

struct Sum {
  double squares = 0, count = 0;
  void Add(double rms, std::size_t readings) {
    squares += rms * rms * static_cast<double>(readings);
    count += static_cast<double>(readings);
  }
  [[nodiscard]] double Rms() const { return count > 0 ? std::sqrt(squares / count) : 0; }
};

// Reports the result. Errors: of the output file.
ExitCode ReportCalibration(const Context& context, const HallCalibrateOptions& options,
                           const std::vector<SensorFit>& fits) {
  Json sensors = Json::array();
  Sum before, held_out;
  std::size_t calibrated = 0;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    sensors.push_back(SensorJson(fits[k], k + 1));
    if (fits[k].status != CalibrationStatus::kOk) continue;
    ++calibrated;
    before.Add(fits[k].rms_before_V, fits[k].readings);
    held_out.Add(fits[k].rms_held_out_V, fits[k].readings);
  }
  if (calibrated == 0)
    return Report(context, {ErrorCode::kInvalid,
                            fmt::format("{}: no sensor can be calibrated; the first is said to be "
                                        "'{}' by {} usable voltages",
                                        options.data, sim::Name(fits.front().status),
                                        fits.front().readings)});
  if (const auto written = WriteFileAtomically(options.out, WriteCalibration(fits)); !written)
    return Report(context, written.error());
  if (context.json)
    PrintJson({{"sensors", sensors},
               {"calibrated", calibrated},
               {"rms_before_mV", before.Rms() * 1e3},
               {"rms_held_out_mV", held_out.Rms() * 1e3},
               {"out", options.out}});
  Say(context, SensorTable(fits));
  Say(context,
      fmt::format("{}: {} of {} sensors calibrated; {:.4g} mV rms before, {:.4g} mV held "
                  "out (five folds by pose)",
                  options.out, calibrated, fits.size(), before.Rms() * 1e3, held_out.Rms() * 1e3));
  return ExitCode::kOk;
}

ExitCode RunHallCalibrate(const Context& context, const HallCalibrateOptions& options) {
  const auto model = LoadFieldAlone(options.model);
  if (!model) return Report(context, model.error());
  auto sensors = SensorsOf(options.sensors);
  if (!sensors) return Report(context, sensors.error());
  const auto rig = RigOf(*model, std::move(*sensors));
  if (!rig) return Report(context, {rig.error().code, options.model + ": " + rig.error().text});
  const auto text = ReadTextFile(options.data);
  if (!text) return Report(context, text.error());
  auto table = ReadPoses(*text, options.data, rig->sensors.size());
  if (!table) return Report(context, table.error());
  ReportPassedOver(context, options.data, table->passed_over);
  const auto field = sim::MakeField(model->field);
  return ReportCalibration(context, options,
                           sim::CalibrateSensors(CampaignOf(std::move(*table)), *rig, *field));
}

}  // namespace

void AddHallCalibrate(CommandLine* line, CLI::App* hall) {
  CLI::App* command = AddCommand(
      hall, "calibrate", "Gain, offset and place of each sensor, from poses that are known",
      "  focalfleet hall calibrate --model model.toml --data poses.csv --out sensors.csv\n"
      "  focalfleet hall orient --model model.toml --sensors sensors.csv --data volts.csv "
      "--out est.csv");
  auto options = std::make_shared<HallCalibrateOptions>();
  AddFile(command, "--model", &options->model,
          "The field, from `hall fit`: taken as it stands, amplitude and phase, too")
      ->required();
  AddFile(command, "--data", &options->data,
          "Poses: alpha_deg, beta_deg, gamma_deg, v1_V, v2_V, ...; temp_C if any")
      ->required();
  AddFile(command, "--out", &options->out,
          "The sensors with standard deviations, for --sensors; or - for stdout")
      ->required();
  AddHallSensorOptions(command, &options->sensors);
  OnChosen(line, command, options, RunHallCalibrate);
}

}  // namespace focalfleet::cli
