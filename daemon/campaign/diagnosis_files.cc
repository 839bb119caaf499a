#include "daemon/campaign/diagnosis_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/verdict_sentence.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/diagnosis/use/left_by.h"
#include "sim/campaigns/effects/empirical.h"

namespace focalfleet {
namespace {

using nlohmann::json;

json Finite(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json CauseJson(const sim::CauseFound& cause) {
  json units = cause.all_units ? json("all") : json(cause.units);
  json posterior = json::object();
  const std::vector<double> of_candidates = sim::PosteriorOf(cause);
  for (std::size_t k = 0; k < cause.candidates.size(); ++k)
    posterior[cause.candidates[k]] = of_candidates[k];
  return {{"cause", cause.cause},
          {"candidates", cause.candidates},
          {"axis", cause.axis},
          {"scope", cause.scope},
          {"units", units},
          {"amplitude", Finite(cause.amplitude)},
          {"amplitude_unit", cause.amplitude_unit},
          {"posterior", posterior},
          {"at_bound", cause.at_bound},
          {"ci95", {Finite(cause.ci95[0]), Finite(cause.ci95[1])}},
          {"rms_um", Finite(cause.size_um)},
          {"delta_log_likelihood", Finite(cause.delta_log_likelihood)},
          {"predicted_gain_um", Finite(cause.predicted_gain_um)},
          {"shape", cause.shape}};
}

json UnknownJson(const sim::UnknownFound& found) {
  json unknown{{"covariate", found.covariate},
               {"channel", found.channel},
               {"p_value", Finite(found.p_value)},
               {"rms_um", Finite(found.size_um)}};
  if (found.patched)
    unknown["patched"] = {{"term", found.patched->term},
                          {"rms_um", Finite(found.patched->size_um)}};
  return unknown;
}

// The JSON of `steps`; null where no steps were found.
json StepsJson(const sim::PlaceSteps& steps) {
  json both = json::array();
  for (const double step_mm : {steps.x_mm, steps.y_mm})
    both.push_back(step_mm > 0 ? json(step_mm) : json(nullptr));
  return both;
}

json GainJson(const sim::HeldOutGain& gain) {
  return {{"rms_before_um", Finite(gain.rms_before_um)},
          {"rms_after_um", Finite(gain.rms_after_um)},
          {"noise_floor_um", Finite(gain.noise_floor_um)},
          {"explained_fraction", Finite(gain.explained_share)},
          {"mad_before_um", Finite(gain.mad_before_um)},
          {"mad_after_um", Finite(gain.mad_after_um)},
          {"held_out", gain.held_out}};
}

std::string Quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + "\"";
}

constexpr int kDigits = 9;

// Pre: all are finite.
std::string NumberList(std::span<const double> values, int digits = kDigits) {
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i)
    text += (i == 0 ? "" : ", ") + fmt::format("{:.{}g}", values[i], digits);
  return text + "]";
}

// A line of TOML; empty where the number is not known.
std::string NumberLine(std::string_view key, double value) {
  return std::isfinite(value) ? fmt::format("{} = {:.{}g}\n", key, value, kDigits) : "";
}

// The state in which the campaign left a unit is written whole or not at all, since a reader
// accepts no part of it.
bool IsReported(const sim::UnitLeft& left) {
  const auto is_known = [](double deg) { return std::isfinite(deg); };
  return left.moved && std::ranges::all_of(left.pose_deg, is_known) &&
         std::ranges::all_of(left.added_deg, is_known);
}

// Where an empirical term acts, and the knots through which its curve is read.
std::string EmpiricalText(const sim::Template& form) {
  std::string text = "covariate = " + Quoted(form.covariate) + "\n";
  text += "channel = " + Quoted(sim::ChannelOf(form)) + "\n";
  if (form.knots.empty()) return text;
  std::vector<double> values, ranks;
  for (const sim::RankKnot& knot : form.knots)
    values.push_back(knot.value), ranks.push_back(knot.rank);
  // Nine digits of a time since 1970 resolve only ten seconds, and knots must ascend. Knots are
  // therefore written to the last digit.
  constexpr int kAllDigits = 17;
  return text + "knot_values = " + NumberList(values, kAllDigits) +
         "\nknot_ranks = " + NumberList(ranks) + "\n";
}

// Rival causes of the term, as this diagnosis found them. If it did not find the cause, those that
// the model before lists; empty: none.
std::vector<std::string> CandidatesOf(const std::string& name, const sim::Diagnosis& diagnosis,
                                      const ReportNames& names) {
  const auto found = std::ranges::find(diagnosis.causes, name, &sim::CauseFound::cause);
  if (found != diagnosis.causes.end()) return found->candidates;
  const auto before = names.candidates_before.find(name);
  return before != names.candidates_before.end() ? before->second : std::vector<std::string>();
}

std::string TermText(const sim::ModelTerm& term, const sim::Diagnosis& diagnosis,
                     const ReportNames& names) {
  std::string text = "\n[[effect]]\n";
  text += "cause = " + Quoted(term.form.effect->cause) + "\n";
  text += "axis = " + Quoted(sim::Name(term.form.axis)) + "\n";
  text += fmt::format("form = {}\nshape = {:.9g}\nmemory = {}\n", term.form.form, term.form.shape,
                      static_cast<int>(term.form.memory));
  text += "shape_text = " + Quoted(term.form.label) + "\n";
  if (sim::FindEmpirical(term.form.effect->cause) != nullptr) text += EmpiricalText(term.form);
  text += "amplitude_unit = " + Quoted(term.form.effect->amplitude_unit) + "\n";
  text += "shared_by = " + Quoted(sim::Name(term.sharing)) + "\n";
  const std::vector<std::string> candidates =
      CandidatesOf(std::string(term.form.effect->cause), diagnosis, names);
  for (std::size_t i = 0; i < candidates.size(); ++i)
    text += (i == 0 ? "candidates = [" : ", ") + Quoted(candidates[i]);
  if (!candidates.empty()) text += "]\n";
  std::vector<double> units, amplitude, sigma, shapes;
  for (std::size_t u = 0; u < term.group_of_unit.size(); ++u) {
    const auto own = term.AmplitudeOf(u);
    if (own.empty()) continue;
    const std::uint32_t id = diagnosis.model.units[u].id;
    const std::optional<double> shape = sim::ShapeOf(term.form, id);
    if (!shape) continue;
    units.push_back(id);
    if (!term.form.shape_of_unit.empty()) shapes.push_back(*shape);
    amplitude.insert(amplitude.end(), own.begin(), own.end());
    const std::size_t at = term.group_of_unit[u] * term.form.columns;
    // 0 means that nothing is known of it.
    for (std::size_t c = 0; c < term.form.columns; ++c)
      sigma.push_back(std::isfinite(term.sigma[at + c]) ? term.sigma[at + c] : 0);
  }
  if (units.empty()) return {};  // no unit has it any more
  text += fmt::format("columns = {}\n", term.form.columns);
  text += "units = " + NumberList(units) + "\n";
  if (!shapes.empty()) text += "shapes = " + NumberList(shapes) + "\n";
  text += "amplitude = " + NumberList(amplitude) + "\n";
  text += "sigma = " + NumberList(sigma) + "\n";
  return text;
}

}  // namespace

json ReportJson(const sim::Diagnosis& diagnosis, const ReportNames& names) {
  json causes = json::array();
  for (const sim::CauseFound& cause : diagnosis.causes) causes.push_back(CauseJson(cause));
  json unknown = json::array();
  for (const sim::UnknownFound& found : diagnosis.unknown) unknown.push_back(UnknownJson(found));
  json not_testable = json::array();
  for (const sim::NotTestable& cause : diagnosis.not_testable)
    not_testable.push_back({{"cause", cause.cause}, {"why", cause.why}});
  const VerdictText text = TextOf(diagnosis);
  json report{{"verdict", sim::Name(diagnosis.verdict)},
              {"sentence", text.says()},
              {"numbers", text.numbers},
              {"causes", causes},
              {"unknown", unknown},
              {"not_testable", not_testable},
              {"outliers",
               {{"rows", diagnosis.outliers.rows},
                {"units", diagnosis.outliers.units},
                {"why", json(diagnosis.outliers.why)}}},
              {"gain", GainJson(diagnosis.gain)},
              {"units_by_class", sim::CountByClass(diagnosis.axes)},
              {"data",
               {{"rows", diagnosis.rows},
                {"units", diagnosis.units},
                {"moves", diagnosis.moves},
                {"place_step_mm", StepsJson(diagnosis.steps)},
                {"sha256", names.sha256}}},
              {"remarks", diagnosis.remarks},
              {"model", {{"before", names.model_before}, {"after", names.model_after}}}};
  if (!diagnosis.insufficient.empty()) report["missing"] = diagnosis.insufficient;
  return report;
}

std::string WriteModel(const sim::Diagnosis& diagnosis, const ReportNames& names,
                       const sim::Campaign& campaign) {
  std::string text = "# The extended model of a campaign, made by `focalfleet diagnose`.\n";
  text += "name = " + Quoted(names.model_after) + "\n";
  text += "campaign = " + Quoted(names.campaign) + "\n";
  text += "campaign_sha256 = " + Quoted(names.sha256) + "\n";
  text += "verdict = " + Quoted(sim::Name(diagnosis.verdict)) + "\n";
  text += NumberLine("rms_before_um", diagnosis.gain.rms_before_um) +
          NumberLine("rms_after_um", diagnosis.gain.rms_after_um);
  for (const sim::ModelTerm& term : diagnosis.model.terms) text += TermText(term, diagnosis, names);
  const std::vector<sim::UnitLeft> left = sim::LeftByCampaign(diagnosis.model, campaign);
  for (std::size_t u = 0; u < diagnosis.model.units.size(); ++u) {
    const sim::CampaignUnit& unit = diagnosis.model.units[u];
    if (std::ranges::count(diagnosis.without_geometry, unit.id) > 0) continue;
    text += fmt::format("\n[[unit]]\nunit_id = {}\n", unit.id);
    if (unit.serial != 0) text += fmt::format("serial = {}\n", unit.serial);
    text += NumberLine("base_x_mm", unit.base_x_mm) + NumberLine("base_y_mm", unit.base_y_mm);
    text += NumberLine("arm_theta_mm", unit.arm_mm[0]) + NumberLine("arm_phi_mm", unit.arm_mm[1]);
    text += NumberLine("theta_zero_deg", unit.zero_deg[0]) +
            NumberLine("phi_zero_deg", unit.zero_deg[1]);
    if (IsReported(left[u]))
      text += NumberLine("left_theta_deg", left[u].pose_deg[0]) +
              NumberLine("left_phi_deg", left[u].pose_deg[1]) +
              NumberLine("added_theta_deg", left[u].added_deg[0]) +
              NumberLine("added_phi_deg", left[u].added_deg[1]);
  }
  return text;
}

std::string WriteUnitsByClass(const sim::Diagnosis& diagnosis) {
  std::string text =
      "unit_id,axis,class,scale_cw,scale_ccw,stalls,stuck_at_deg,wraps,rms_um,moves\n";
  const auto number = [](std::optional<double> value, int decimals) {
    return value && std::isfinite(*value) ? fmt::format("{:.{}f}", *value, decimals) : "";
  };
  for (const sim::AxisReport& axis : diagnosis.axes)
    text += fmt::format(
        "{},{},{},{},{},{},{},{},{},{}\n", axis.unit_id, axis.axis == sim::kTheta ? "theta" : "phi",
        sim::Name(axis.is), number(axis.scale_cw, 4), number(axis.scale_ccw, 4), axis.stalls,
        number(axis.stuck_at_deg, 2), axis.wraps, number(axis.rms_um, 1), axis.moves);
  return text;
}

std::string Decimals(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "?";
}

std::string Significant(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "?";
}

}  // namespace focalfleet
