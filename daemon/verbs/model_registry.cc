#include "daemon/verbs/model_registry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/access/sha256.h"

namespace focalfleet {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// An effect of the model: number of units, size, uncertainty, other candidates.
Json TermJson(const sim::ModelTerm& term, const std::vector<std::string>& candidates) {
  std::vector<double> size, sigma;
  std::size_t units = 0;
  for (std::size_t u = 0; u < term.group_of_unit.size(); ++u) {
    const auto amplitude = term.AmplitudeOf(u);
    if (amplitude.empty()) continue;
    ++units;
    double sum = 0, doubt = 0;
    for (std::size_t c = 0; c < amplitude.size(); ++c) {
      sum += amplitude[c] * amplitude[c];
      doubt = std::max(doubt, term.sigma[term.group_of_unit[u] * amplitude.size() + c]);
    }
    size.push_back(std::sqrt(sum));
    sigma.push_back(doubt);
  }
  return {{"cause", term.form.effect->cause},
          {"axis", sim::Name(term.form.axis)},
          {"shape", term.form.label},
          {"units", units},
          {"amplitude_median", Number(Median(size))},
          {"sigma_median", Number(Median(sigma))},
          {"amplitude_unit", term.form.effect->amplitude_unit},
          {"candidates", candidates}};
}

Json ChangeJson(const ModelHistory& change) {
  const ModelRow& row = change.row;
  return {{"entry", row.entry},
          {"at", ToIso8601(change.at)},
          {"name", row.sha256.empty() ? Json(nullptr) : Json(row.name)},
          {"sha256", row.sha256.empty() ? Json(nullptr) : Json(row.sha256)},
          {"campaign", row.campaign},
          {"campaign_sha256", row.campaign_sha256},
          {"rms_before_um", Number(row.rms_before_um)},
          {"rms_after_um", Number(row.rms_after_um)},
          {"restores", row.restores == 0 ? Json(nullptr) : Json(row.restores)}};
}

}  // namespace

void ModelRegistry::Take(ModelInForce model) {
  file_ = std::move(model.file);
  compensation_ = std::move(model.compensation);
}

ModelRow ModelRegistry::Append(ModelRow row) {
  row.entry = changes_.empty() ? 1 : changes_.back().row.entry + 1;
  ModelRow kept = row;
  kept.text.reset();
  changes_.push_back({std::move(kept), now_()});
  return row;
}

void ModelRegistry::TakeChanges(std::vector<ModelHistory> newest_first) {
  changes_.assign(std::make_move_iterator(newest_first.rbegin()),
                  std::make_move_iterator(newest_first.rend()));
  changes_known_ = true;
}

Status ModelRegistry::Restore(const std::string& text) {
  FOCALFLEET_TRY_ASSIGN(ModelInForce model,
                        ReadModelInForce(text, "model " + changes_.back().row.name, *layout_));
  Take(std::move(model));
  return {};
}

Result<ModelRow> ModelRegistry::Load(const std::string& text, const std::string& file) {
  const std::string sha256 = Sha256Hex(text);
  FOCALFLEET_TRY_ASSIGN(ModelInForce model, ReadModelInForce(text, file, *layout_));
  if (compensation_ && changes_.back().row.sha256 == sha256)
    return Fail(ErrorCode::kRefused, file + ": it is in force already");
  ModelRow row{.entry = 0,
               .sha256 = sha256,
               .restores = 0,
               .name = model.file.model.name,
               .campaign = model.file.campaign,
               .campaign_sha256 = model.file.campaign_sha256,
               .rms_before_um = model.file.rms_before_um,
               .rms_after_um = model.file.rms_after_um,
               .text = std::make_shared<const std::string>(text)};
  Take(std::move(model));
  return Append(std::move(row));
}

Result<ModelRow> ModelRegistry::Unload() {
  if (changes_.empty() || changes_.back().row.sha256.empty())
    return Fail(ErrorCode::kRefused, "no model is in force");
  file_.reset();
  compensation_.reset();
  return Append({});
}

std::size_t ModelRegistry::Origin(std::size_t index) const {
  const std::uint64_t entry = changes_[index].row.restores;
  if (entry == 0) return index;
  const auto origin = std::ranges::find_if(
      changes_, [&](const ModelHistory& change) { return change.row.entry == entry; });
  return origin == changes_.end() ? index : static_cast<std::size_t>(origin - changes_.begin());
}

std::uint64_t ModelRegistry::since() const {
  return changes_[Origin(changes_.size() - 1)].row.entry;
}

Result<ModelRow> ModelRegistry::Rollback(
    const std::function<Result<std::string>(const std::string&)>& text_of) {
  if (changes_.empty()) return Fail(ErrorCode::kRefused, "there was never a model");
  // A restored model has the past of the change that it restores.
  const std::size_t origin = Origin(changes_.size() - 1);
  if (origin == 0) {  // no model was in force before the first one
    if (compensation_) return Unload();
    return Fail(ErrorCode::kRefused, "there is no model before this");
  }
  ModelRow row = changes_[origin - 1].row;
  row.restores = row.restores != 0 ? row.restores : row.entry;
  if (row.sha256.empty()) {
    file_.reset();
    compensation_.reset();
    return Append(std::move(row));
  }
  FOCALFLEET_TRY_ASSIGN(const std::string text, text_of(row.sha256));
  FOCALFLEET_TRY_ASSIGN(ModelInForce model, ReadModelInForce(text, "model " + row.name, *layout_));
  Take(std::move(model));
  return Append(std::move(row));
}

Json ModelRegistry::Show(std::size_t changes_max) const {
  Json changes = Json::array();
  for (std::size_t n = changes_.size(); n-- > 0 && changes.size() < changes_max;)
    changes.push_back(ChangeJson(changes_[n]));
  if (!file_) return {{"in_force", nullptr}, {"changes", std::move(changes)}};
  Json in_force = ChangeJson(changes_.back());
  in_force["verdict"] = file_->verdict;
  in_force["units"] = compensation_->units();
  in_force["left_out"] = compensation_->left_out();
  Json effects = Json::array();
  for (std::size_t t = 0; t < file_->model.terms.size(); ++t)
    effects.push_back(TermJson(file_->model.terms[t], file_->candidates[t]));
  in_force["effects"] = std::move(effects);
  return {{"in_force", std::move(in_force)}, {"changes", std::move(changes)}};
}

}  // namespace focalfleet
