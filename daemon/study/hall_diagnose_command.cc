// The command hall diagnose tests the model of the Hall sensors with poses of known orientation.

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "daemon/access/sha256.h"
#include "daemon/cli/table.h"
#include "daemon/cli/table_input.h"
#include "daemon/files/text_file.h"
#include "daemon/hall/hall_report.h"
#include "daemon/study/hall_options.h"

namespace focalfleet::cli {
namespace {

struct HallDiagnoseOptions {
  std::string data;
  std::string out;
  std::string model;
  HallSensorOptions sensors;
  double arm_mm = 8;
};

// The model is the paper's surface for its 3D array. Its amplitude is free in every diagnosis, so
// any value will do.
HallModelFile PaperModel() {
  return {.name = "surface 21 deg",
          .origin = "the paper's 3D array",
          .field = sim::SurfaceParameters{.amplitude_T = 0.08},
          .peak_T = 0.08};
}

Status WriteAll(const std::filesystem::path& out, const sim::HallDiagnosis& diagnosis,
                const sim::HallCampaign& campaign, const HallModelFile& extended,
                const HallReportNames& names) {
  std::error_code failed;
  std::filesystem::create_directories(out, failed);
  if (failed)
    return Fail(ErrorCode::kUnavailable, fmt::format("{}: {}", out.string(), failed.message()));
  FOCALFLEET_TRY(WriteFileAtomically(out / "model.toml", WriteHallModel(extended)));
  FOCALFLEET_TRY(WriteFileAtomically(out / "next_moves.csv", WriteNextPoses(diagnosis)));
  FOCALFLEET_TRY(
      WriteFileAtomically(out / "report.html", HallReportPage(diagnosis, campaign, names)));
  // report.json is written last: where it exists, all files exist.
  return WriteFileAtomically(
      out / "report.json",
      HallReportJson(diagnosis, names).dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::string CauseTable(const sim::HallDiagnosis& diagnosis) {
  std::vector<std::vector<std::string>> rows = {
      {"cause", "what", "amplitude", "rms (mV)", "2 d ln L", "rivals"}};
  for (const sim::HallCauseFound& cause : diagnosis.causes) {
    std::string rivals;
    for (std::size_t k = 1; k < cause.candidates.size(); ++k)
      rivals += fmt::format("{}{}", rivals.empty() ? "" : ", ", sim::Name(cause.candidates[k]));
    rows.push_back({sim::Name(cause.candidates.front()), cause.text,
                    fmt::format("{:.4g} {}", cause.amplitude, cause.amplitude_unit),
                    fmt::format("{:.3g}", cause.size_V * 1e3), fmt::format("{:.0f}", cause.chi2),
                    rivals.empty() ? "-" : rivals});
  }
  return AlignColumns(rows);
}

ExitCode RunHallDiagnose(const Context& context, const HallDiagnoseOptions& options) {
  HallModelFile model = PaperModel();
  if (!options.model.empty()) {
    auto loaded = LoadHallModel(options.model);
    if (!loaded) return Report(context, loaded.error());
    model = std::move(*loaded);
  }
  auto sensors = SensorsOf(options.sensors);
  if (!sensors) return Report(context, sensors.error());
  const auto rig = RigOf(model, std::move(*sensors));
  if (!rig) return Report(context, {rig.error().code, options.model + ": " + rig.error().text});
  const auto text = ReadTable(context, options.data, "alpha_deg");
  if (!text) return Report(context, text.error());
  auto table = ReadPoses(*text, options.data, rig->sensors.size());
  if (!table) return Report(context, table.error());
  ReportPassedOver(context, options.data, table->passed_over);
  const sim::HallCampaign campaign = CampaignOf(std::move(*table));
  const auto field = sim::MakeField(model.field);
  const sim::HallDiagnosis diagnosis = sim::DiagnoseHall(campaign, *rig, *field);
  const HallReportNames names{.data = options.data,
                              .sha256 = Sha256Hex(*text),
                              .model_before = model.name,
                              .model_after = model.name + ", extended",
                              .arm_mm = options.arm_mm,
                              .rows = campaign.rows.size()};
  const HallModelFile extended = ExtendedModel(model, diagnosis, campaign, *field, names);
  if (const auto written = WriteAll(options.out, diagnosis, campaign, extended, names); !written)
    return Report(context, written.error());
  if (context.json) PrintJson(HallReportJson(diagnosis, names));
  Say(context, HallVerdictSentence(diagnosis));
  if (!diagnosis.causes.empty()) Say(context, CauseTable(diagnosis));
  if (diagnosis.verdict != sim::HallVerdict::kInsufficient)
    Say(context, fmt::format("held out: {:.4g} mV rms before, {:.4g} mV after; noise {:.4g} mV",
                             diagnosis.gain.rms_before_V * 1e3, diagnosis.gain.rms_after_V * 1e3,
                             diagnosis.noise_V * 1e3));
  Say(context, options.out + "/{report.json, report.html, model.toml, next_moves.csv}");
  return ExitCode::kOk;
}

}  // namespace

sim::HallCampaign CampaignOf(PoseTable table) {
  sim::HallCampaign campaign;
  campaign.poses = std::move(table.poses);
  campaign.rows = std::move(table.rows);
  campaign.has_temperature = table.has_temperature;
  double sum = 0, count = 0;
  for (const sim::VoltageRow& row : campaign.rows)
    if (std::isfinite(row.temperature_C)) {
      sum += row.temperature_C;
      count += 1;
    }
  if (count > 0) campaign.temperature_mean_C = sum / count;
  return campaign;
}

void AddHallDiagnose(CommandLine* line, CLI::App* hall) {
  CLI::App* command = AddCommand(
      hall, "diagnose", "What is wrong with the model of the sensors, from poses that are known",
      "  focalfleet hall diagnose --data poses.csv --out report\n"
      "  focalfleet hall diagnose --model model.toml --data poses.csv --out report");
  auto options = std::make_shared<HallDiagnoseOptions>();
  AddFile(command, "--data", &options->data,
          "Poses: alpha_deg, beta_deg, gamma_deg, v1_V, v2_V, ...; temp_C if any")
      ->required();
  command
      ->add_option("--out", options->out,
                   "Folder for report.json, report.html, model.toml, next_moves.csv")
      ->required()
      ->type_name("DIR");
  AddFile(command, "--model", &options->model,
          "The model to judge (default: the paper's surface of 21 deg, amplitude free)");
  AddHallSensorOptions(command, &options->sensors);
  command->add_option("--arm-mm", options->arm_mm, "From the joint's centre to the fibre, for um")
      ->check(NumberBetween(0.1, 1e4))
      ->capture_default_str();
  OnChosen(line, command, options, RunHallDiagnose);
}

}  // namespace focalfleet::cli
