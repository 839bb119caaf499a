#include "sim/campaigns/diagnosis/search/find_model.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "sim/campaigns/diagnosis/search/multi_start.h"
#include "sim/campaigns/diagnosis/terms/homings.h"
#include "sim/campaigns/diagnosis/terms/image.h"

namespace focalfleet::sim {
namespace {

constexpr double kUndecided = 6;  // 2 d ln L between two interpretations of the temperatures

// Tries the fit with the image's motion found first, and returns whether the fit is that one now.
// Common motions of all units move the image, and its motion looks like causes of theirs. With the
// image found first fewer causes may be needed.
bool TryImageFirst(const Templates& templates, const DiagnoseOptions& options,
                   const SelectionRule& rule, Fit* fit, ImageFound* image, Selection* selection) {
  Fit anew = *fit;
  anew.model.terms.clear();
  anew.model.events.clear();
  anew.model.exposures.clear();
  UpdateResiduals(&anew);
  StepFit(&anew);
  SettleFit(&anew, 3);
  ImageFound first = AddImageTerms(&anew, options.family_wise);
  if (!first.moves) return false;
  Selection again = SelectMultiStart(templates, rule, &anew);
  if (BetterBy(anew, *fit) <= 0) return false;
  again.kept_share = std::move(selection->kept_share);
  *fit = std::move(anew);
  *image = std::move(first);
  *selection = std::move(again);
  return true;
}

// BIC's price of the shares carried.
double PriceOfWalk(const Fit& fit) {
  double shares = 0, values = 0;
  for (const double share : fit.noise.carry) shares += share > 0 ? 1 : 0;
  for (std::size_t row = 0; row < fit.weight.size(); ++row) values += fit.Used(row) ? 2 : 0;
  return shares * std::log(std::max(values, 2.0));
}

// The terms, steps, zeros of homings and motion of the image that explain the data.
Selection FindTerms(const Templates& templates, const DiagnoseOptions& options,
                    const SelectionRule& rule, Fit* fit, Diagnosis* diagnosis) {
  Selection selection = SelectMultiStart(templates, rule, fit);
  ImageFound image = AddImageTerms(fit, options.family_wise);
  const auto report_homings = [&] {
    if (!fit->model.homing_zero_deg[kTheta].empty()) diagnosis->causes.push_back(HomingCause(*fit));
  };
  if (!image.moves) {
    report_homings();
    return selection;
  }
  // The shares of templates that the image's motion hid, or that replaced it.
  std::vector<double> kept = std::move(selection.kept_share);
  const bool has_terms = !fit->model.terms.empty();
  selection = Select(templates, rule, fit);
  selection.kept_share = std::move(kept);
  if (has_terms) TryImageFirst(templates, options, rule, fit, &image, &selection);
  report_homings();
  if (image.followed) diagnosis->unknown.push_back(std::move(*image.followed));
  if (image.cause && !IsLeftOut(options, image.cause->cause)) {
    std::erase_if(image.cause->candidates,
                  [&](const std::string& name) { return IsLeftOut(options, name); });
    diagnosis->causes.push_back(std::move(*image.cause));
  }
  AddDriftAsRival(image.drift_um, *fit, &selection);
  return selection;
}

double AtItsPrice(const Fit& walk) { return NegativeBic(walk) - PriceOfWalk(walk); }

// Drops terms that a walk explains as well once they are gone. Beside such a term the walk's noise
// is fitted to what the term leaves, and the term's evidence is by that noise.
void DropWhatTheWalkTakes(Fit* fit, Selection* selection) {
  for (std::size_t t = 0; t < fit->model.terms.size();) {
    Fit without = *fit;
    without.model.terms.erase(without.model.terms.begin() + static_cast<std::ptrdiff_t>(t));
    FitAnew(&without);
    if (AtItsPrice(without) < AtItsPrice(*fit)) {
      ++t;
      continue;
    }
    *fit = std::move(without);
    selection->accepted.erase(selection->accepted.begin() + static_cast<std::ptrdiff_t>(t));
    t = 0;
  }
}

// Explains the data without and, where that pays, with rest errors that moves take along. Such a
// walk can take the place of most effects: it is a hypothesis beside them, with its price.
Selection FindTermsOrWalk(const Templates& templates, const DiagnoseOptions& options,
                          const SelectionRule& rule, Fit* fit, Diagnosis* diagnosis) {
  constexpr int kRounds = 2;
  Fit anew = *fit;
  Diagnosis with_walk = *diagnosis;
  Selection selection = FindTerms(templates, options, rule, fit, diagnosis);
  Fit walks = *fit;
  walks.noise.may_carry = true;
  SettleFit(&walks, kRounds);
  const double plain = NegativeBic(*fit);
  if (AtItsPrice(walks) <= plain) return selection;
  anew.noise.may_carry = true;
  SettleFit(&anew, kRounds);
  Selection again = FindTerms(templates, options, rule, &anew, &with_walk);
  DropWhatTheWalkTakes(&anew, &again);
  if (AtItsPrice(anew) <= plain) return selection;
  *fit = std::move(anew);
  *diagnosis = std::move(with_walk);
  return again;
}

}  // namespace

bool IsLeftOut(const DiagnoseOptions& options, std::string_view cause) {
  return std::find(options.leave_out.begin(), options.leave_out.end(), cause) !=
         options.leave_out.end();
}

double RmsOf(const Fit& fit) {
  double sum = 0, count = 0;
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.weight[row] > 0.5)
      sum += fit.x_um[row] * fit.x_um[row] + fit.y_um[row] * fit.y_um[row], count += 1;
  return count > 0 ? std::sqrt(sum / count) : 0;
}

Selection FindModel(const Templates& templates, const DiagnoseOptions& options,
                    const SelectionRule& rule, const TrueTemperatures* truth, Fit* fit,
                    Diagnosis* diagnosis) {
  if (truth == nullptr) return FindTermsOrWalk(templates, options, rule, fit, diagnosis);
  Diagnosis corrected = *diagnosis;
  Selection selection = FindTermsOrWalk(templates, options, rule, fit, diagnosis);
  const auto cannot = [&](const char* why) {
    diagnosis->not_testable.push_back(
        {std::string(kSensorBias), std::string("sensors are suspect, ") + why});
    return selection;
  };
  Fit by_others = StartFit(truth->facts, corrected.model, fit->aside, options.parallel);
  Selection again = FindTermsOrWalk(templates, options, rule, &by_others, &corrected);
  if (!ReadsTemperature(by_others.model)) return cannot("but nothing goes with the temperature");
  const double better = BetterBy(by_others, *fit);
  if (better < -kUndecided) return selection;
  const bool is_better = better > kUndecided;
  if (!is_better && truth->owner == Owner::kUnit) return cannot("and these moves do not decide");
  CauseFound cause = SensorCause(by_others, *truth, *fit->facts, is_better && !truth->are_half);
  const double rms_um = RmsOf(by_others);
  cause.predicted_gain_um = std::hypot(rms_um, cause.size_um) - rms_um;
  if (is_better) {
    cause.delta_log_likelihood = better / 2;
    *fit = std::move(by_others);
    *diagnosis = std::move(corrected);
    selection = std::move(again);
  }
  diagnosis->causes.push_back(std::move(cause));
  return selection;
}

}  // namespace focalfleet::sim
