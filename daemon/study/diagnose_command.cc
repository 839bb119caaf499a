// The command diagnose names what the simulation gets wrong about a measured campaign. With
// --against it shows which of two models predicts the campaign better. The command simulate
// campaign makes an artificial campaign with chosen effects.

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <regex>

#include "daemon/campaign/campaign_files.h"
#include "daemon/campaign/class_table.h"
#include "daemon/campaign/diagnosis_files.h"
#include "daemon/campaign/diagnosis_page.h"
#include "daemon/campaign/next_moves_file.h"
#include "daemon/campaign/verdict_sentence.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/study/compare_models_command.h"
#include "daemon/study/measured_campaign.h"
#include "daemon/study/study.h"
#include "daemon/tables/read_table.h"
#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet::cli {
namespace {

struct DiagnoseCommandOptions {
  std::string campaign;
  std::string out;
  std::uint64_t seed = 1;
  int threads = 0;  // 0: all cores of the machine
  std::vector<std::string> leave_out;
  std::uint64_t shuffle = 0;
  std::string model;
  std::string against;
  bool patch = false;
};

Status CheckCauses(const std::vector<std::string>& causes) {
  for (const std::string& cause : causes)
    if (sim::FindEffect(cause) == nullptr)
      return Fail(ErrorCode::kInvalid, "--without: there is no effect '" + cause + "'");
  return {};
}

Status WriteReport(const std::filesystem::path& out, const MeasuredCampaign& in,
                   const sim::Diagnosis& diagnosis, const Json& report) {
  std::error_code failed;
  std::filesystem::create_directories(out, failed);
  if (failed)
    return Fail(ErrorCode::kUnavailable, fmt::format("{}: {}", out.string(), failed.message()));
  FOCALFLEET_TRY(
      WriteFileAtomically(out / "model.toml", WriteModel(diagnosis, in.names, in.campaign)));
  FOCALFLEET_TRY(WriteFileAtomically(out / "next_moves.csv",
                                     WriteNextMoves(in.campaign.units, diagnosis.next.moves)));
  FOCALFLEET_TRY(
      WriteFileAtomically(out / "report.html", DiagnosisPage(in.campaign, diagnosis, in.names)));
  FOCALFLEET_TRY(WriteFileAtomically(out / "units_by_class.csv", WriteUnitsByClass(diagnosis)));
  // report.json is written last: where it exists, all files exist.
  return WriteFileAtomically(out / "report.json",
                             report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::string CauseTable(const sim::Diagnosis& diagnosis) {
  std::vector<std::vector<std::string>> rows = {
      {"cause", "axis", "scope", "units", "amplitude", "um rms", "2 d ln L", "rivals"}};
  for (const sim::CauseFound& cause : diagnosis.causes) {
    std::string rivals;
    for (std::size_t k = 1; k < cause.candidates.size(); ++k)
      rivals += (rivals.empty() ? "" : ", ") + cause.candidates[k];
    rows.push_back({cause.cause, cause.axis, cause.scope,
                    cause.all_units ? "all" : std::to_string(cause.units.size()),
                    Significant(cause.amplitude, 4) + " " + cause.amplitude_unit,
                    Decimals(cause.size_um, 2), Decimals(2 * cause.delta_log_likelihood, 0),
                    rivals.empty() ? "-" : rivals});
  }
  return AlignColumns(rows);
}

// The classes of axes; empty where none calls for a repair.
std::string ClassTable(const sim::Diagnosis& diagnosis) {
  if (std::ranges::none_of(diagnosis.axes, NeedsRepair, &sim::AxisReport::is)) return "";
  std::vector<std::vector<std::string>> rows = ClassRows(diagnosis.axes);
  rows.insert(rows.begin(), kClassColumns);
  return AlignColumns(rows);
}

// A table of the findings that the model's empirical terms patch without explaining them; empty
// where there are none.
std::string PatchTable(const sim::Diagnosis& diagnosis) {
  std::vector<std::vector<std::string>> rows = {
      {"patched, not explained", "in", "against", "um rms"}};
  for (const sim::UnknownFound& found : diagnosis.unknown)
    if (found.patched)
      rows.push_back({found.patched->term, found.channel, found.covariate,
                      Decimals(found.patched->size_um, 2)});
  return rows.size() == 1 ? "" : AlignColumns(rows);
}

// The error where options do not go together on the command line; empty where they do.
std::string WrongUsage(const DiagnoseCommandOptions& options) {
  if (options.against.empty())
    return options.out.empty() ? "--out is required (or --against, to compare two models)" : "";
  if (!options.out.empty())
    return "--out and --against exclude each other: a comparison of models writes no report";
  if (options.patch || options.shuffle != 0 || !options.leave_out.empty())
    return "--against fits nothing: --patch, --without and --shuffle have no meaning with it";
  return {};
}

ExitCode RunDiagnose(const Context& context, const DiagnoseCommandOptions& options) {
  if (const std::string wrong = WrongUsage(options); !wrong.empty())
    return Report(context, Error{ErrorCode::kInvalid, wrong}, ExitCode::kUsage);
  if (!options.against.empty())
    return RunCompareModels(context, {.campaign = options.campaign,
                                      .model_a = options.model,
                                      .model_b = options.against,
                                      .seed = options.seed,
                                      .threads = options.threads});
  if (const auto known = CheckCauses(options.leave_out); !known)
    return Report(context, known.error(), ExitCode::kUsage);
  auto in = ReadMeasuredCampaign(context, options.campaign);
  if (!in) return Report(context, in.error());
  std::optional<sim::CampaignModel> before;
  if (!options.model.empty()) {
    auto read = ReadModelFor(in->campaign, options.model);
    if (!read) return Report(context, read.error());
    in->names.model_before = read->model.name;
    for (std::size_t t = 0; t < read->candidates.size(); ++t)
      in->names.candidates_before[std::string(read->model.terms[t].form.effect->cause)] =
          read->candidates[t];
    before = std::move(read->model);
  }
  sim::Diagnosis diagnosis;
  {
    ProgressBar bar(context);
    sim::DiagnoseOptions wanted{.seed = options.seed,
                                .leave_out = options.leave_out,
                                .shuffle_library = options.shuffle,
                                .before = before ? &*before : nullptr,
                                .patch = options.patch,
                                .parallel = OnThreads(options.threads)};
    wanted.progress = [&](double share, std::string_view stage) {
      bar.Show(share, "diagnosing", std::string(stage));
    };
    diagnosis = sim::Diagnose(in->campaign, wanted);
  }
  const Json report = ReportJson(diagnosis, in->names);
  if (const auto written = WriteReport(options.out, *in, diagnosis, report); !written)
    return Report(context, written.error());
  if (context.json) PrintJson(report);
  Say(context, VerdictSentence(diagnosis));
  for (const std::string& remark : diagnosis.remarks) Say(context, "note: " + remark);
  if (!diagnosis.causes.empty()) Say(context, CauseTable(diagnosis));
  if (const std::string classes = ClassTable(diagnosis); !classes.empty()) Say(context, classes);
  for (const auto& [why, rows] : diagnosis.outliers.why)
    Say(context, fmt::format("{} of {} rows: {}", rows, diagnosis.rows, why));
  if (!diagnosis.outliers.units.empty())
    Say(context, fmt::format("stuck, or off by far more than others and by no cause: unit {}",
                             fmt::join(diagnosis.outliers.units, ", ")));
  if (const std::string patches = PatchTable(diagnosis); !patches.empty()) Say(context, patches);
  Say(context,
      options.out + "/{report.json, report.html, model.toml, next_moves.csv, units_by_class.csv}");
  return ExitCode::kOk;
}

// ---- simulate campaign

struct SimulateCampaignOptions {
  sim::PlantedOptions planted;
  std::vector<std::string> effects;
  double unit_share = 1;
  std::string next;
  std::string of;
  std::string model;
  std::string out;
};

// The moves of a measured campaign, with the positions that the model predicts. A position that was
// not seen stays so.
Result<sim::Campaign> Predicted(const Context& context, const SimulateCampaignOptions& options) {
  FOCALFLEET_TRY_ASSIGN(MeasuredCampaign measured, ReadMeasuredCampaign(context, options.of));
  sim::Campaign& campaign = measured.campaign;
  FOCALFLEET_TRY_ASSIGN(const ModelFile file, ReadModelFor(campaign, options.model));
  sim::Campaign begun = campaign;  // by the geometry that its closed loops were turned with
  begun.units = sim::FindCoordinatorsGeometry(campaign);
  const sim::Places places = sim::Predict(file.model, sim::MakeFacts(begun), OnThreads(0));
  Rng rng = Rng::Stream(options.planted.seed, "predicted");
  const auto measure = [&](double place_mm) {
    return place_mm + 1e-3 * options.planted.noise_um * rng.Normal();
  };
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    if (!std::isfinite(campaign.x_mm[row])) continue;
    campaign.x_mm[row] = measure(places.x_mm[row]);
    campaign.y_mm[row] = measure(places.y_mm[row]);
  }
  // The camera's statements on its own positions are not true of these.
  std::erase_if(campaign.covariates,
                [](const sim::Covariate& column) { return column.name == "sigma_um"; });
  return campaign;
}

// The campaign and, with `next`, the moves of that list after it.
Result<sim::Campaign> Simulate(sim::PlantedOptions planted, const std::string& next) {
  FOCALFLEET_TRY_ASSIGN(sim::Campaign campaign, sim::PlantCampaign(planted));
  if (next.empty()) return campaign;
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(next, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(planted.next, ReadNextMoves(text, next, campaign.units));
  return sim::PlantCampaign(planted);
}

Result<sim::PlantedEffect> EffectOf(const std::string& text) {
  static const std::regex kForm("([a-z_]+)(:([a-z]+))?(#([0-9]{1,3}))?=([-+.0-9eE]+)");
  std::smatch part;
  sim::PlantedEffect effect;
  const auto take = [&](std::size_t group, auto* number) {
    const std::string digits = part[group].str();
    const auto [end, problem] =
        std::from_chars(digits.data(), digits.data() + digits.size(), *number);
    return problem == std::errc() && end == digits.data() + digits.size();
  };
  if (!std::regex_match(text, part, kForm) || !take(6, &effect.amplitude) ||
      (part[5].matched && !take(5, &effect.form)))
    return Fail(ErrorCode::kInvalid,
                "--effect " + text + ": cause[:axis][#shape]=amplitude is expected");
  effect.cause = part[1].str();
  effect.axis = part[3].str();
  return effect;
}

ExitCode RunSimulateCampaign(const Context& context, const SimulateCampaignOptions& options) {
  sim::PlantedOptions planted = options.planted;
  for (const std::string& text : options.effects) {
    const auto effect = EffectOf(text);
    if (!effect) return Report(context, effect.error(), ExitCode::kUsage);
    planted.effects.push_back(*effect);
    planted.effects.back().unit_share = options.unit_share;
  }
  std::error_code failed;
  if (!options.of.empty() && std::filesystem::equivalent(options.of, options.out, failed))
    return Report(context,
                  Error{ErrorCode::kInvalid, options.out + ": is what was measured; name another "
                                                           "folder for what is predicted"},
                  ExitCode::kUsage);
  const bool reads_files = !options.of.empty() || !options.next.empty();
  const auto campaign =
      options.of.empty() ? Simulate(planted, options.next) : Predicted(context, options);
  if (!campaign)
    return Report(context, campaign.error(), reads_files ? ExitCode::kRefused : ExitCode::kUsage);
  std::filesystem::create_directories(options.out, failed);
  if (failed)
    return Report(context, Error{ErrorCode::kUnavailable, options.out + ": " + failed.message()});
  const std::filesystem::path folder(options.out);
  for (const auto& [name, text] : {std::pair("units.csv", WriteCampaignUnits(*campaign)),
                                   std::pair("moves.csv", WriteMoves(*campaign))})
    if (const auto written = WriteFileAtomically(folder / name, text); !written)
      return Report(context, written.error());
  if (context.json)
    PrintJson({{"out", options.out},
               {"units", campaign->units.size()},
               {"rows", campaign->rows()},
               {"seed", planted.seed}});
  Say(context, fmt::format("{}/{{units.csv, moves.csv}}: {} rows of {} units", options.out,
                           campaign->rows(), campaign->units.size()));
  return ExitCode::kOk;
}

}  // namespace

void AddDiagnoseCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "diagnose", "Name what the simulation gets wrong about a measured campaign",
      "  focalfleet diagnose night-12 --out night-12-report\n"
      "  focalfleet diagnose night-12 --out without --without backlash,relaxation --json\n"
      "  focalfleet diagnose night-12 --out patched --patch\n"
      "  focalfleet diagnose night-40 --model night-12-report/model.toml --against "
      "night-40-report/model.toml");
  auto options = std::make_shared<DiagnoseCommandOptions>();
  command->add_option("campaign", options->campaign, "Folder with moves.csv and units.csv")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--out", options->out,
                   "Folder for report.json, report.html, model.toml, next_moves.csv, "
                   "units_by_class.csv; required but "
                   "with --against")
      ->type_name("DIR");
  command
      ->add_option("--seed", options->seed,
                   "Of the calibration by chance; with --against, of the interval")
      ->capture_default_str();
  command
      ->add_option("--threads", options->threads,
                   "Threads (default: all cores); the verdict is the same with any number")
      ->check(CLI::Range(1, 256));
  command->add_option("--without", options->leave_out, "Causes to leave out of the library")
      ->delimiter(',');
  command->add_option("--shuffle", options->shuffle,
                      "Look at the library in another order; the verdict is the same");
  AddFile(
      command, "--model", &options->model,
      "model.toml to start from: what it explains is no misfit (default: the ideal kinematics)");
  AddFile(command, "--against", &options->against,
          "model.toml to hold against --model on these moves, as both stand: no fit, no report");
  command->add_flag("--patch", options->patch,
                    "Empirical terms in the model for what is unknown; they name nothing");
  OnChosen(line, command, options, RunDiagnose);
}

void AddSimulateCampaign(CLI::App* parent, CommandLine* line) {
  CLI::App* command = AddCommand(parent, "campaign", "A made-up campaign with chosen effects in it",
                                 "  focalfleet simulate campaign --units 60 --moves 80 --effect "
                                 "backlash:theta=0.1 --out made\n"
                                 "  focalfleet simulate campaign --effect gravity_sag=5 --effect "
                                 "eccentricity:phi=0.2 --out two\n"
                                 "  focalfleet simulate campaign --effect stiction:theta#24=1 "
                                 "--effect lost_command=2 --unit-share 0.1 --out jumps\n"
                                 "  focalfleet simulate campaign --of night-12 --model "
                                 "night-12-report/model.toml --noise-um 0 --out predicted");
  auto options = std::make_shared<SimulateCampaignOptions>();
  sim::PlantedOptions& planted = options->planted;
  command->add_option(
      "--effect", options->effects,
      "cause[:axis][#shape]=amplitude, in the cause's own unit; repeat. Shapes count "
      "from 0; one that there is not, as #999, lists them");
  command->add_option("--unit-share", options->unit_share, "Of the units, who have the effects")
      ->check(NumberBetween(0, 1))
      ->capture_default_str();
  command->add_option("--units", planted.units, "Units, on a hexagonal lattice")
      ->check(CLI::Range(1, 20000))
      ->capture_default_str();
  command->add_option("--moves", planted.moves, "Moves of each unit")
      ->check(CLI::Range(1, 2000))
      ->capture_default_str();
  command->add_option("--seed", planted.seed, "Of all that is drawn")->capture_default_str();
  command->add_option("--noise-um", planted.noise_um, "Of one measured coordinate")
      ->check(NumberBetween(0, 1e4))
      ->capture_default_str();
  command->add_option("--outliers", planted.outlier_share, "Share of places that are anywhere")
      ->check(NumberBetween(0, 0.5))
      ->capture_default_str();
  AddFile(command, "--next", &options->next,
          "next_moves.csv of a diagnosis of this campaign: its moves are made after the others");
  CLI::Option* of = command->add_option(
      "--of", options->of,
      "Folder of a measured campaign: its moves, where --model says that they end");
  of->type_name("DIR");
  for (const char* made :
       {"--effect", "--unit-share", "--units", "--moves", "--outliers", "--next"})
    of->excludes(made);
  CLI::Option* model = AddFile(command, "--model", &options->model,
                               "model.toml of a diagnosis, that is to predict it");
  of->needs(model);
  model->needs(of);
  command->add_option("--out", options->out, "Folder for units.csv and moves.csv; made if missing")
      ->required()
      ->type_name("DIR");
  OnChosen(line, command, options, RunSimulateCampaign);
}

}  // namespace focalfleet::cli
