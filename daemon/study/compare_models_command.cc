#include "daemon/study/compare_models_command.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "daemon/cli/table.h"
#include "daemon/study/measured_campaign.h"
#include "sim/campaigns/diagnosis/use/compare_models.h"

namespace focalfleet::cli {
namespace {

/// A model of the two, as the command line gives it.
struct Side {
  std::string letter;
  std::string file;  // empty: none was given
  ModelFile read;
};

struct Compared {
  std::string campaign;
  std::string sha256;
  Side a, b;
  sim::ModelComparison result;
  sim::ModelDifference difference;
};

Json Finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Result<Side> ReadSide(const std::string& letter, const std::string& file,
                      const sim::Campaign& campaign) {
  Side side{.letter = letter, .file = file, .read = {}};
  if (file.empty()) {
    side.read.model.units = campaign.units;
    side.read.units_known = campaign.units.size();
    return side;
  }
  FOCALFLEET_TRY_ASSIGN(side.read, ReadModelFor(campaign, file));
  return side;
}

bool IsFittedToThese(const Side& side, const Compared& compared) {
  if (!side.read.campaign_sha256.empty()) return side.read.campaign_sha256 == compared.sha256;
  return !side.read.campaign.empty() && side.read.campaign == compared.campaign;
}

std::string VerdictOf(sim::Preference preference) {
  if (preference == sim::Preference::kA) return "A is better";
  if (preference == sim::Preference::kB) return "B is better";
  return "no difference that these data show";
}

std::vector<std::string> NotesOf(const Compared& compared) {
  std::vector<std::string> notes;
  for (const auto& [side, judged] :
       {std::pair(&compared.a, &compared.result.a), std::pair(&compared.b, &compared.result.b)}) {
    if (IsFittedToThese(*side, compared))
      notes.push_back(side->letter +
                      " was fitted to these very moves: it does better here than on others");
    const std::size_t units = side->read.model.units.size();
    if (side->read.units_known < units)
      notes.push_back(fmt::format("{} does not know {} of {} units: they go by units.csv",
                                  side->letter, units - side->read.units_known, units));
    for (const sim::NotTestable& term : judged->left_out)
      notes.push_back(
          fmt::format("{} is judged without its {}: {}", side->letter, term.cause, term.why));
  }
  if (compared.result.exposures < sim::kExposuresForPreference)
    notes.push_back(fmt::format("{} are too few to prefer a model; {} are needed",
                                Count(compared.result.exposures, "exposure", "exposures"),
                                sim::kExposuresForPreference));
  return notes;
}

Json SideJson(const Side& side, const sim::JudgedModel& judged, const Compared& compared) {
  Json left_out = Json::array();
  for (const sim::NotTestable& term : judged.left_out)
    left_out.push_back({{"cause", term.cause}, {"why", term.why}});
  return {{"name", side.read.model.name},
          {"file", side.file.empty() ? Json(nullptr) : Json(side.file)},
          {"rms_um", Finite(judged.rms_um)},
          {"mad_um", Finite(judged.mad_um)},
          {"units_known", side.read.units_known},
          {"fitted_to_these_moves", IsFittedToThese(side, compared)},
          {"left_out", left_out}};
}

void AddSide(const std::optional<sim::TermSide>& side, const std::string& letter, Json* term) {
  const bool spread = side && side->amplitude.sigma > 0;
  (*term)["amplitude_" + letter] = side ? Finite(side->amplitude.value) : Json(nullptr);
  (*term)["sigma_" + letter] = spread ? Finite(side->amplitude.sigma) : Json(nullptr);
  (*term)["units_" + letter] = side ? side->units : 0;
  (*term)["shape_" + letter] = side ? side->shape : "";
}

Json TermsJson(const sim::ModelDifference& difference) {
  Json terms = Json::array();
  for (const sim::TermDifference& term : difference.terms) {
    Json one = {{"cause", term.cause},
                {"axis", term.axis},
                {"in", term.a && term.b ? "both"
                       : term.a         ? "a"
                                        : "b"},
                {"amplitude_unit", term.amplitude_unit},
                {"difference_sigmas", Finite(term.sigmas)}};
    AddSide(term.a, "a", &one);
    AddSide(term.b, "b", &one);
    terms.push_back(std::move(one));
  }
  return terms;
}

Json ComparisonJson(const Compared& compared) {
  const sim::ModelComparison& result = compared.result;
  Json geometry = Json::array();
  for (const sim::GeometryDifference& one : compared.difference.geometry)
    geometry.push_back({{"what", one.what},
                        {"unit", one.unit},
                        {"rms", Finite(one.rms)},
                        {"largest", Finite(one.largest)},
                        {"largest_unit_id", one.largest_unit}});
  return {{"campaign", compared.campaign},
          {"sha256", compared.sha256},
          {"rows", result.rows},
          {"exposures", result.exposures},
          {"left_out", Json(result.left_out)},
          {"a", SideJson(compared.a, result.a, compared)},
          {"b", SideJson(compared.b, result.b, compared)},
          {"difference",
           {{"rms_um", Finite(result.difference_um)},
            {"ci95_um", {Finite(result.ci95_um[0]), Finite(result.ci95_um[1])}}}},
          {"verdict", VerdictOf(result.preference)},
          {"terms", TermsJson(compared.difference)},
          {"geometry", geometry},
          {"notes", NotesOf(compared)}};
}

std::string ModelTable(const Compared& compared) {
  std::vector<std::vector<std::string>> rows = {{"", "model", "rows", "um rms", "um median"}};
  for (const auto& [side, judged] :
       {std::pair(&compared.a, &compared.result.a), std::pair(&compared.b, &compared.result.b)})
    rows.push_back({side->letter,
                    side->read.model.name + (side->file.empty() ? "" : " (" + side->file + ")"),
                    std::to_string(compared.result.rows), fmt::format("{:.2f}", judged->rms_um),
                    fmt::format("{:.2f}", judged->mad_um)});
  return AlignColumns(rows);
}

std::string AmplitudeCell(const std::optional<sim::TermSide>& side) {
  if (!side) return "-";
  const sim::AmplitudeSummary& amplitude = side->amplitude;
  if (!(amplitude.sigma > 0)) return fmt::format("{:.4g}", amplitude.value);
  return fmt::format("{:.4g} +- {:.1g}", amplitude.value, amplitude.sigma);
}

std::string DifferenceTables(const sim::ModelDifference& difference) {
  std::string text;
  if (!difference.terms.empty()) {
    std::vector<std::vector<std::string>> rows = {
        {"term", "axis", "in", "A", "B", "unit", "sigmas apart"}};
    for (const sim::TermDifference& term : difference.terms)
      rows.push_back({term.cause, term.axis,
                      term.a && term.b ? "both"
                      : term.a         ? "A"
                                       : "B",
                      AmplitudeCell(term.a), AmplitudeCell(term.b), term.amplitude_unit,
                      std::isfinite(term.sigmas) ? fmt::format("{:.1f}", term.sigmas) : "-"});
    text += AlignColumns(rows) + "\n\n";
  }
  std::vector<std::vector<std::string>> rows = {
      {"geometry, B less A", "rms", "largest", "", "of unit"}};
  for (const sim::GeometryDifference& one : difference.geometry)
    rows.push_back({one.what, fmt::format("{:.4g}", one.rms), fmt::format("{:.4g}", one.largest),
                    one.unit, one.largest == 0 ? "-" : std::to_string(one.largest_unit)});
  return text + AlignColumns(rows);
}

std::string ComparisonText(const Compared& compared) {
  const sim::ModelComparison& result = compared.result;
  std::string text = ModelTable(compared) + "\n\n";
  text += fmt::format("{}: B less A {:+.3f} um rms (95 %: {:+.3f} to {:+.3f}, {} drawn anew)\n",
                      VerdictOf(result.preference), result.difference_um, result.ci95_um[0],
                      result.ci95_um[1], Count(result.exposures, "exposure", "exposures"));
  std::string left_out;
  for (const auto& [why, rows] : result.left_out)
    left_out += fmt::format("{}{} {}", left_out.empty() ? "" : ", ", rows, why);
  if (!left_out.empty()) text += "rows left out of both: " + left_out + "\n";
  for (const std::string& note : NotesOf(compared)) text += "note: " + note + "\n";
  return text + "\n" + DifferenceTables(compared.difference);
}

}  // namespace

ExitCode RunCompareModels(const Context& context, const CompareModelsOptions& options) {
  const auto in = ReadMeasuredCampaign(context, options.campaign);
  if (!in) return Report(context, in.error());
  auto a = ReadSide("A", options.model_a, in->campaign);
  if (!a) return Report(context, a.error());
  auto b = ReadSide("B", options.model_b, in->campaign);
  if (!b) return Report(context, b.error());
  Compared compared{.campaign = in->names.campaign,
                    .sha256 = in->names.sha256,
                    .a = std::move(*a),
                    .b = std::move(*b),
                    .result = {},
                    .difference = {}};
  const sim::ModelPair models{&compared.a.read.model, &compared.b.read.model};
  compared.result = sim::CompareModels(
      models, in->campaign, {.seed = options.seed, .parallel = OnThreads(options.threads)});
  if (compared.result.rows == 0)
    return Report(context, {ErrorCode::kInvalid,
                            options.campaign + ": no row is left by which models can be judged"});
  compared.difference = sim::DifferenceOf(models);
  if (context.json) PrintJson(ComparisonJson(compared));
  Say(context, ComparisonText(compared));
  return ExitCode::kOk;
}

}  // namespace focalfleet::cli
