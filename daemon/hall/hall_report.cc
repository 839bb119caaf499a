#include "daemon/hall/hall_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/report/page.h"
#include "fleet/files/csv.h"
#include "sim/hall/field_fit.h"

namespace focalfleet {
namespace {

using Json = nlohmann::json;
using sim::HallCause;
using sim::HallDiagnosis;
using sim::HallVerdict;
using sim::kRadPerDeg;

double UmPerV(const HallDiagnosis& diagnosis, const HallReportNames& names) {
  return diagnosis.sensitivity_V_per_rad > 0 ? names.arm_mm * 1e3 / diagnosis.sensitivity_V_per_rad
                                             : 0;
}

Json Finite(double number) { return std::isfinite(number) ? Json(number) : Json(nullptr); }

Json SensorList(const std::vector<std::size_t>& sensors) {
  Json list = Json::array();
  for (const std::size_t sensor : sensors) list.push_back(sensor + 1);
  return list;
}

Json CauseJson(const sim::HallCauseFound& cause, double um_per_V) {
  Json candidates = Json::array();
  for (const HallCause candidate : cause.candidates) candidates.push_back(sim::Name(candidate));
  return {{"cause", sim::Name(cause.candidates.front())},
          {"candidates", candidates},
          {"axis", "none"},
          {"scope", "unit"},
          {"units", cause.sensors.empty() ? Json("all") : SensorList(cause.sensors)},
          {"term", cause.text},
          {"amplitude", Finite(cause.amplitude)},
          {"amplitude_unit", cause.amplitude_unit},
          {"ci95", {Finite(cause.ci95[0]), Finite(cause.ci95[1])}},
          {"rms_um", Finite(cause.size_V * um_per_V)},
          {"rms_mV", Finite(cause.size_V * 1e3)},
          {"delta_log_likelihood", Finite(cause.chi2 / 2)},
          {"predicted_gain_um", Finite(cause.predicted_gain_V * um_per_V)}};
}

std::string Rivals(const sim::HallCauseFound& cause) {
  std::string text;
  for (std::size_t k = 1; k < cause.candidates.size(); ++k)
    text += fmt::format("{}{}", k == 1 ? "" : ", ", sim::Name(cause.candidates[k]));
  return text;
}

std::string WhoText(const std::vector<std::size_t>& sensors) {
  std::string text;
  for (const std::size_t sensor : sensors)
    text += fmt::format("{}v{}", text.empty() ? "" : " and ", sensor + 1);
  return text;
}

void AddResiduals(const HallDiagnosis& diagnosis, const sim::HallCampaign& campaign,
                  report::Page* page) {
  if (diagnosis.before_V.empty()) return;
  page->Heading("Residuals");
  std::vector<double> before, after, alpha, beta, gamma, sensor;
  for (std::size_t k = 0; k < diagnosis.readings.size(); ++k) {
    const sim::Orientation& pose = campaign.poses[diagnosis.readings[k].row];
    before.push_back(diagnosis.before_V[k] * 1e3);
    after.push_back(diagnosis.after_V[k] * 1e3);
    alpha.push_back(pose.alpha_rad / kRadPerDeg);
    beta.push_back(pose.beta_rad / kRadPerDeg);
    gamma.push_back(pose.gamma_rad / kRadPerDeg);
    sensor.push_back(static_cast<double>(diagnosis.readings[k].sensor + 1));
  }
  const std::pair<const char*, const std::vector<double>*> against[] = {
      {"alpha", &alpha}, {"beta", &beta}, {"gamma", &gamma}, {"sensor", &sensor}};
  for (const auto& [name, x] : against)
    page->Plot(report::DrawLines(
        {.title = std::string("residual against ") + name,
         .x = {.label = name, .unit = x == &sensor ? "" : "deg"},
         .y = {.label = "measured less model", .unit = "mV"},
         .series = {{.name = "before", .x = *x, .y = before, .style = report::Style::kDots},
                    {.name = "after", .x = *x, .y = after, .style = report::Style::kDots}}}));
}

// A spherical model of the field as the diagnosis found it: the extended field on a grid, fitted.
sim::FieldParameters ExtendedField(const HallDiagnosis& diagnosis, const sim::FieldModel& field,
                                   const sim::HallRig& nominal) {
  sim::HallCampaign still;
  still.poses.emplace_back();
  still.rows.push_back({std::vector<double>(1, 0)});
  sim::FieldMap map;
  sim::HallRig probe = nominal;
  probe.sensors.assign(1, sim::HallSensor{});
  const sim::ParameterLayout one = sim::LayoutOf(1);
  Eigen::VectorXd parameters = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(one.size()));
  const auto copy = [&](std::size_t from, std::size_t to) {
    parameters[static_cast<Eigen::Index>(to)] =
        diagnosis.parameters[static_cast<Eigen::Index>(from)];
  };
  for (const std::size_t k : {sim::ParameterLayout::kAmplitude, sim::ParameterLayout::kPhase,
                              sim::ParameterLayout::kWidth})
    copy(k, k);
  for (std::size_t k = 0; k < one.terms.size(); ++k) copy(diagnosis.layout.term(k), one.term(k));
  for (int theta = 2; theta < 180; theta += 4)
    for (int phi = 0; phi < 360; phi += 4) {
      probe.sensors[0].direction = sim::DirectionAt(theta * kRadPerDeg, phi * kRadPerDeg);
      const sim::HallForward forward(still, probe, field);
      Eigen::VectorXd volts;
      forward.Predict(parameters, {{0, 0}}, &volts);
      map.push_back(
          {theta * kRadPerDeg, phi * kRadPerDeg,
           (volts[0] - probe.electronics.zero_V()) / probe.electronics.sensitivity_V_per_T});
    }
  auto fit = sim::FitField(map, sim::FieldKind::kSpherical);
  return fit ? fit->parameters : sim::FieldParameters{sim::SurfaceParameters{}};
}

}  // namespace

Json HallReportJson(const HallDiagnosis& diagnosis, const HallReportNames& names) {
  const double um_per_V = UmPerV(diagnosis, names);
  Json causes = Json::array(), unknown = Json::array(), not_testable = Json::array();
  for (const auto& cause : diagnosis.causes) causes.push_back(CauseJson(cause, um_per_V));
  for (const auto& found : diagnosis.unknown)
    unknown.push_back({{"covariate", found.covariate},
                       {"p_value", Finite(found.p_value)},
                       {"rms_um", Finite(found.rms_V * um_per_V)}});
  for (const auto& [cause, why] : diagnosis.not_testable)
    not_testable.push_back({{"cause", sim::Name(cause)}, {"why", why}});
  Json troubled = Json::array(), troubles = Json::array();
  for (const auto& trouble : diagnosis.troubles) {
    for (const std::size_t sensor : trouble.sensors) troubled.push_back(sensor + 1);
    troubles.push_back({{"what", trouble.what}, {"sensors", SensorList(trouble.sensors)}});
  }
  const sim::HallGain& gain = diagnosis.gain;
  Json report{
      {"verdict", sim::Name(diagnosis.verdict)},
      {"causes", causes},
      {"unknown", unknown},
      {"not_testable", not_testable},
      {"outliers",
       {{"rows", diagnosis.outlier_rows}, {"units", troubled}, {"why", Json(diagnosis.outliers)}}},
      {"sensors", troubles},
      {"gain",
       {{"rms_before_um", Finite(gain.rms_before_V * um_per_V)},
        {"rms_after_um", Finite(gain.rms_after_V * um_per_V)},
        {"noise_floor_um", Finite(diagnosis.noise_V * um_per_V)},
        {"explained_fraction", Finite(gain.explained)},
        {"mad_before_um", Finite(gain.mad_before_V * um_per_V)},
        {"mad_after_um", Finite(gain.mad_after_V * um_per_V)},
        {"rms_before_mV", Finite(gain.rms_before_V * 1e3)},
        {"rms_after_mV", Finite(gain.rms_after_V * 1e3)},
        {"noise_floor_mV", Finite(diagnosis.noise_V * 1e3)},
        {"um_per_mV", Finite(um_per_V * 1e-3)},
        {"held_out", gain.held_out}}},
      {"data",
       {{"rows", names.rows},
        {"units", diagnosis.layout.sensors},
        {"moves", names.rows},
        {"sha256", names.sha256}}},
      {"model", {{"before", names.model_before}, {"after", names.model_after}}}};
  if (!diagnosis.missing.empty()) report["missing"] = diagnosis.missing;
  return report;
}

std::string HallVerdictSentence(const HallDiagnosis& diagnosis) {
  std::string causes;
  for (const auto& cause : diagnosis.causes)
    causes += fmt::format("{}{} ({})", causes.empty() ? "" : ", ",
                          sim::Name(cause.candidates.front()), cause.text);
  for (const auto& trouble : diagnosis.troubles)
    causes +=
        fmt::format("{}{} {}", causes.empty() ? "" : ", ", WhoText(trouble.sensors), trouble.what);
  switch (diagnosis.verdict) {
    case HallVerdict::kConsistent:
      return "Consistent: the model explains the voltages to their noise.";
    case HallVerdict::kExplained:
      return "Explained: " + causes + ".";
    case HallVerdict::kAmbiguous:
      return "Ambiguous: " + causes + "; these poses do not separate every cause from its rivals.";
    case HallVerdict::kUnknown:
      return fmt::format("Unknown: a structure against {} remains that no cause explains{}{}.",
                         diagnosis.unknown.front().covariate, causes.empty() ? "" : "; besides ",
                         causes);
    case HallVerdict::kInsufficient:
      return "Insufficient: " + diagnosis.missing + ".";
  }
  return "";
}

std::string HallReportPage(const HallDiagnosis& diagnosis, const sim::HallCampaign& campaign,
                           const HallReportNames& names) {
  const double um_per_V = UmPerV(diagnosis, names);
  report::Page page("What these poses say about the model of the Hall sensors");
  page.Paragraph(HallVerdictSentence(diagnosis));
  if (!diagnosis.causes.empty()) {
    page.Heading("Causes");
    std::vector<std::vector<std::string>> rows;
    for (const auto& cause : diagnosis.causes)
      rows.push_back({sim::Name(cause.candidates.front()), cause.text,
                      cause.candidates.size() > 1 ? Rivals(cause) : "none",
                      fmt::format("{:.4g} ({:.4g} to {:.4g}) {}", cause.amplitude, cause.ci95[0],
                                  cause.ci95[1], cause.amplitude_unit),
                      fmt::format("{:.3g}", cause.size_V * 1e3),
                      fmt::format("{:.3g}", cause.size_V * um_per_V),
                      fmt::format("{:.0f}", cause.chi2)});
    page.Table({"cause", "what", "cannot be told from", "amplitude (95 %)", "rms (mV)",
                "rms at the fibre (um)", "2 d ln L"},
               rows);
  }
  if (diagnosis.verdict != HallVerdict::kInsufficient) {
    page.Heading("Gain on poses that no fit has seen");
    page.Paragraph(diagnosis.gain.held_out + ".");
    page.Plot(report::DrawBars(
        {.title = "residual of a voltage",
         .categories = {"rms", "median"},
         .y = {.label = "residual", .unit = "mV"},
         .groups = {{"model as given",
                     {diagnosis.gain.rms_before_V * 1e3, diagnosis.gain.mad_before_V * 1e3}},
                    {"extended model",
                     {diagnosis.gain.rms_after_V * 1e3, diagnosis.gain.mad_after_V * 1e3}}},
         .horizontal = {{diagnosis.noise_V * 1e3, "noise"}}}));
  }
  AddResiduals(diagnosis, campaign, &page);
  if (!diagnosis.unknown.empty()) {
    page.Heading("What no cause explains");
    std::vector<std::vector<std::string>> rows;
    for (const auto& found : diagnosis.unknown)
      rows.push_back({found.covariate, fmt::format("{:.2g}", found.p_value),
                      fmt::format("{:.3g}", found.rms_V * 1e3)});
    page.Table({"against", "p", "rms (mV)"}, rows);
  }
  for (const auto& [cause, why] : diagnosis.not_testable)
    page.Paragraph(fmt::format("Not testable: {}, {}.", sim::Name(cause), why));
  if (!diagnosis.outliers.empty()) {
    page.Heading("Voltages left out");
    std::vector<std::vector<std::string>> rows;
    for (const auto& [why, count] : diagnosis.outliers)
      rows.push_back({why, std::to_string(count)});
    page.Table({"why", "voltages"}, rows, {report::Align::kLeft, report::Align::kRight});
  }
  page.Paragraph(diagnosis.next_poses.empty()
                     ? "Nothing is confusable: no further poses are needed to tell causes apart."
                     : "next_moves.csv has the poses that would tell most.");
  page.Paragraph(fmt::format(
      "{} poses of {}, sha256 {}; model before: {}; {:g} mm from the joint to the fibre.",
      names.rows, names.data, names.sha256, names.model_before, names.arm_mm));
  return page.Html();
}

HallModelFile ExtendedModel(const HallModelFile& before, const HallDiagnosis& diagnosis,
                            const sim::HallCampaign& campaign, const sim::FieldModel& field,
                            const HallReportNames& names) {
  HallModelFile model = before;
  model.name = names.model_after;
  model.origin = names.data;
  model.sha256 = names.sha256;
  model.notes.push_back(HallVerdictSentence(diagnosis));
  if (diagnosis.verdict == HallVerdict::kInsufficient) return model;
  const sim::ParameterLayout& layout = diagnosis.layout;
  const auto at = [&](std::size_t k) { return diagnosis.parameters[static_cast<Eigen::Index>(k)]; };
  const auto sd = [&](std::size_t k) { return diagnosis.sd[static_cast<Eigen::Index>(k)]; };
  sim::HallRig nominal;
  nominal.radius_mm = before.radius_mm;
  model.field = ExtendedField(diagnosis, field, nominal);
  model.noise_T = diagnosis.noise_V / nominal.electronics.sensitivity_V_per_T;
  model.centre_mm = before.centre_mm + sim::Vector3{at(sim::ParameterLayout::kCentre),
                                                    at(sim::ParameterLayout::kCentre + 1),
                                                    at(sim::ParameterLayout::kCentre + 2)};
  model.decay += at(sim::ParameterLayout::kDecay);
  model.decay_known = before.decay_known || at(sim::ParameterLayout::kDecay) != 0;
  if (at(sim::ParameterLayout::kTemperature) != 0) {
    model.temperature_per_K = at(sim::ParameterLayout::kTemperature);
    model.temperature_reference_C = campaign.temperature_mean_C;
  }
  for (std::size_t s = 0; s < layout.sensors; ++s) {
    const auto known =
        std::find_if(model.sensors.begin(), model.sensors.end(),
                     [&](const SensorCalibration& sensor) { return sensor.sensor == s; });
    if (known == model.sensors.end() && at(layout.gain(s)) == 0 && at(layout.offset(s)) == 0 &&
        at(layout.shift(s)) == 0 && at(layout.shift(s) + 1) == 0)
      continue;
    SensorCalibration& sensor =
        known != model.sensors.end() ? *known : model.sensors.emplace_back();
    sensor.sensor = s;
    sensor.gain *= 1 + at(layout.gain(s));
    sensor.offset_V += at(layout.offset(s));
    sensor.shift_east_rad += at(layout.shift(s));
    sensor.shift_north_rad += at(layout.shift(s) + 1);
    model.notes.push_back(fmt::format(
        "sensor {}: gain {:.6g} +- {:.2g}, offset {:.4g} +- {:.2g} V, moved {:.4g} +- {:.2g} deg "
        "east, {:.4g} +- {:.2g} deg north",
        s + 1, sensor.gain, sd(layout.gain(s)), sensor.offset_V, sd(layout.offset(s)),
        sensor.shift_east_rad / kRadPerDeg, sd(layout.shift(s)) / kRadPerDeg,
        sensor.shift_north_rad / kRadPerDeg, sd(layout.shift(s) + 1) / kRadPerDeg));
  }
  for (const auto& cause : diagnosis.causes)
    model.notes.push_back(fmt::format("{}: {:.5g} ({:.5g} to {:.5g}) {}",
                                      sim::Name(cause.candidates.front()), cause.amplitude,
                                      cause.ci95[0], cause.ci95[1], cause.amplitude_unit));
  return model;
}

std::string WriteNextPoses(const HallDiagnosis& diagnosis) {
  CsvWriter csv({"alpha_deg", "beta_deg", "gamma_deg"});
  for (const sim::Orientation& pose : diagnosis.next_poses)
    csv.Number(pose.alpha_rad / kRadPerDeg)
        .Number(pose.beta_rad / kRadPerDeg)
        .Number(pose.gamma_rad / kRadPerDeg)
        .EndRow();
  return csv.Take();
}

}  // namespace focalfleet
