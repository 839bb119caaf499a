#include "tests/hidden/score/verdicts.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace focalfleet::hidden {

namespace {

using Json = nlohmann::json;

// A field that a report leaves out, or has in another type, counts as missing; no report may end
// the scoring.
double Number(const Json& from, const char* name) {
  const auto at = from.is_object() ? from.find(name) : from.end();
  return at != from.end() && at->is_number() ? at->get<double>() : 0;
}
std::string Text(const Json& from, const char* name) {
  const auto at = from.is_object() ? from.find(name) : from.end();
  return at != from.end() && at->is_string() ? at->get<std::string>() : "";
}
Json List(const Json& from, const char* name) {
  const auto at = from.is_object() ? from.find(name) : from.end();
  return at != from.end() && at->is_array() ? *at : Json::array();
}
Json Part(const Json& from, const char* name) {
  const auto at = from.is_object() ? from.find(name) : from.end();
  return at != from.end() && at->is_object() ? *at : Json::object();
}
std::set<std::string> Words(const Json& from, const char* name) {
  std::set<std::string> words;
  for (const Json& word : List(from, name))
    if (word.is_string()) words.insert(word.get<std::string>());
  return words;
}
std::set<int> Units(const Json& from) {
  std::set<int> units;
  for (const Json& unit : List(from, "units"))
    if (unit.is_number_integer()) units.insert(unit.get<int>());
  return units;
}

TrueEffect ReadEffect(const Json& json) {
  TrueEffect effect;
  effect.cause = Text(json, "cause");
  effect.foreign = effect.cause.rfind("other_", 0) == 0;
  effect.axis = Text(json, "axis");
  effect.scopes = Words(json, "scope_also");
  effect.scopes.insert(Text(json, "scope"));
  effect.units = Units(json);
  effect.lambda = Number(json, "lambda_per_freedom");
  effect.survival = Number(json, "survival");
  effect.rms_um = Number(json, "rms_um");
  effect.rms_left_um = Number(json, "rms_left_um");
  effect.equivalent = Words(json, "equivalent");
  effect.inseparable = Words(json, "inseparable");
  for (const auto& word : Words(json, "missing_columns")) effect.missing_columns.push_back(word);
  for (const auto& word : Words(json, "covariates")) effect.covariates.push_back(word);
  return effect;
}

NamedCause ReadNamed(const Json& json) {
  NamedCause named;
  named.cause = Text(json, "cause");
  named.candidates = Words(json, "candidates");
  named.candidates.insert(named.cause);
  if (const auto posterior = json.find("posterior"); posterior != json.end())
    for (const auto& [cause, probability] : posterior->items())
      if (probability.is_number()) named.posterior[cause] = probability.get<double>();
  named.axis = Text(json, "axis");
  named.scope = Text(json, "scope");
  named.units = Units(json);
  named.rms_um = Number(json, "rms_um");
  return named;
}

void ReadReport(const Json& report, Case* out) {
  out->verdict = Text(report, "verdict");
  out->has_report = !out->verdict.empty();
  if (!out->has_report) return;
  for (const Json& cause : List(report, "causes")) out->named.push_back(ReadNamed(cause));
  for (const Json& unknown : List(report, "unknown"))
    out->unknown_covariates.push_back(Text(unknown, "covariate"));
  out->says_unknown = out->verdict == "unknown" || !out->unknown_covariates.empty();
  for (const Json& item : List(report, "not_testable"))
    out->not_testable.insert(Text(item, "cause"));
  const Json gain = Part(report, "gain");
  out->before_um = Number(gain, "rms_before_um");
  out->after_um = Number(gain, "rms_after_um");
}

}  // namespace

bool IsStatic(const std::string& cause) {
  return cause == "zero_offset" || cause == "base_offset" || cause == "arm_length";
}

Result<Case> ReadCase(const std::string& name, const std::string& key, const std::string& report) {
  const Json json = Json::parse(key, nullptr, false);
  if (!json.is_object() || Text(json, "kind").empty())
    return Fail(ErrorCode::kInvalid, name + ": key.json is not a key");
  Case out;
  out.name = name;
  out.kind = Text(json, "kind");
  out.dirty = Text(json, "class") == "dirty";
  out.design = Text(json, "design");
  for (const Json& effect : List(json, "effects")) out.effects.push_back(ReadEffect(effect));
  out.also_true = Words(json, "also_true");
  const Json geometry = Part(json, "static");
  out.static_planted = geometry.find("planted") != geometry.end() && geometry["planted"] == true;
  const Json lambdas = Part(geometry, "lambda");  // items() of a temporary would dangle
  for (const auto& [cause, lambda] : lambdas.items())
    if (lambda.is_number()) out.static_lambda.emplace_back(cause, lambda.get<double>());
  const Json oracle = Part(json, "oracle");
  out.oracle_before_um = Number(oracle, "rms_before_um");
  out.oracle_after_um = Number(oracle, "rms_after_um");
  ReadReport(Json::parse(report, nullptr, false), &out);
  return out;
}

bool Case::IsTrue(const std::string& cause) const {
  return std::any_of(effects.begin(), effects.end(), [&](const TrueEffect& effect) {
    return effect.cause == cause || effect.equivalent.count(cause) != 0;
  });
}

}  // namespace focalfleet::hidden
