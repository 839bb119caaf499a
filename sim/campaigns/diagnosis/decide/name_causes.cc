#include "sim/campaigns/diagnosis/decide/name_causes.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/search/find_model.h"
#include "sim/campaigns/diagnosis/terms/events.h"
#include "sim/campaigns/diagnosis/terms/geometry_causes.h"
#include "sim/campaigns/diagnosis/terms/image_followed.h"
#include "sim/campaigns/diagnosis/terms/outliers.h"
#include "sim/campaigns/effects/other_causes.h"
#include "sim/campaigns/effects/rotor_ways.h"

namespace focalfleet::sim {
namespace {

std::string ScopeOf(const ModelTerm& term, std::size_t units) {
  if (term.sharing == Sharing::kUnit || units == 1)
    return std::string(Name(units == 1 && term.form.effect->owner != Owner::kUnit
                                ? term.form.effect->owner
                                : Owner::kUnit));
  if (term.sharing == Sharing::kRail || term.sharing == Sharing::kBus)
    return std::string(Name(term.sharing));
  return std::string(
      Name(term.form.effect->owner == Owner::kUnit ? Owner::kPlate : term.form.effect->owner));
}

CauseFound CauseOf(const Fit& fit, const ModelTerm& term, const Accepted& accepted, double rms_um) {
  const Effect& effect = *term.form.effect;
  CauseFound cause = CauseNamed(effect.cause);
  for (const Rival& rival : accepted.rivals) {
    cause.candidates.emplace_back(rival.cause);
    cause.log_odds[std::string(rival.cause)] = std::min(rival.log_odds, 0.0);
  }
  if (accepted.log_odds_of_curve)
    cause.log_odds[std::string(kSomethingUnknown)] = *accepted.log_odds_of_curve;
  cause.axis = Name(term.form.axis);
  cause.scope = ScopeOf(term, fit.model.units.size());
  std::size_t have = 0, all = 0;
  const Campaign& campaign = *fit.facts->campaign;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    if (campaign.first_row[unit] == campaign.first_row[unit + 1]) continue;
    ++all;
    if (term.group_of_unit[unit] == kNoGroup) continue;
    ++have;
    cause.units.push_back(campaign.units[unit].id);
  }
  constexpr double kNearlyAll = 0.9;
  cause.all_units = static_cast<double>(have) >= kNearlyAll * static_cast<double>(all);
  cause.amplitude_unit = effect.amplitude_unit;
  const AmplitudeSummary amplitude = Summarise(term);
  cause.amplitude = amplitude.value;
  // An amplitude is no better known than the shape that it belongs to.
  const double sigma = std::hypot(amplitude.sigma, effect.discrepancy * amplitude.value);
  cause.ci95[0] = amplitude.value - 1.96 * sigma;
  cause.ci95[1] = amplitude.value + 1.96 * sigma;
  const auto [low, high] = RangeOfAmplitude(effect);
  const auto at_bound = std::ranges::count_if(
      term.amplitude, [&](double one) { return (low < 0 && one <= low) || one >= high; });
  cause.at_bound = at_bound > 0;
  // Units that do not have the effect have an amplitude of zero.
  const auto there = std::ranges::count_if(term.amplitude, [](double one) { return one != 0; });
  if (at_bound > 0) cause.bound_share = static_cast<double>(at_bound) / static_cast<double>(there);
  const TermTrace trace = TraceOf(fit, term);
  // No error moves a fibre farther than across its patrol disc.
  double disc_um = 0;
  for (const CampaignUnit& unit : fit.model.units)
    disc_um = std::max(disc_um, 2 * kUmPerMm * (unit.arm_mm[kTheta] + unit.arm_mm[kPhi]));
  cause.size_um = std::min(trace.rms_um, disc_um);
  cause.delta_log_likelihood = accepted.evidence.chi_square / 2;
  cause.predicted_gain_um = std::hypot(rms_um, cause.size_um) - rms_um;
  cause.shape = term.form.label;
  cause.paragraph = effect.paragraph;
  return cause;
}

// Whether the weaker cause may be the stronger one's, with rotors of the same axis. Few harmonics
// follow a bent wave, and the next of them may pass for another cause of rotors.
bool IsOfTheSameRotor(const CauseFound& weaker, const CauseFound& stronger) {
  return HasRotorWays(weaker.cause) && HasRotorWays(stronger.cause) &&
         weaker.axis == stronger.axis && std::ranges::count(weaker.candidates, stronger.cause) != 0;
}

// Merges causes of one name, of both axes or of several shapes, into one entry.
void MergeCauses(std::vector<CauseFound>* causes) {
  // The strongest part comes first. A rival that the data do not separate from it is a rival of the
  // whole. A rival of a weak part alone does not explain the whole.
  std::stable_sort(causes->begin(), causes->end(), [](const CauseFound& a, const CauseFound& b) {
    return a.delta_log_likelihood > b.delta_log_likelihood;
  });
  std::vector<CauseFound> merged;
  for (CauseFound& cause : *causes) {
    const auto same = std::find_if(merged.begin(), merged.end(), [&](const CauseFound& other) {
      return other.cause == cause.cause || IsOfTheSameRotor(cause, other);
    });
    if (same == merged.end()) {
      merged.push_back(std::move(cause));
      continue;
    }
    if (same->axis != cause.axis) same->axis = "both";
    if (cause.size_um > same->size_um) {
      same->amplitude = cause.amplitude;
      same->ci95[0] = cause.ci95[0], same->ci95[1] = cause.ci95[1];
      same->shape = cause.shape;
      same->scope = cause.scope;
    }
    AddUnits(cause, &*same);
    same->at_bound = same->at_bound || cause.at_bound;
    same->bound_share = std::max(same->bound_share, cause.bound_share);
    if (const auto curve = cause.log_odds.find(std::string(kSomethingUnknown));
        curve != cause.log_odds.end()) {
      double& odds = same->log_odds.emplace(*curve).first->second;
      odds = std::max(odds, curve->second);
    }
    same->size_um = std::hypot(same->size_um, cause.size_um);
    same->delta_log_likelihood += cause.delta_log_likelihood;
    for (std::string& name : cause.cannot_be) same->cannot_be.push_back(std::move(name));
    same->predicted_gain_um += cause.predicted_gain_um;
  }
  std::stable_sort(merged.begin(), merged.end(), [](const CauseFound& a, const CauseFound& b) {
    return a.delta_log_likelihood > b.delta_log_likelihood;
  });
  *causes = std::move(merged);
}

}  // namespace

void AddUnits(const CauseFound& more, CauseFound* cause) {
  std::set<std::uint32_t> units(cause->units.begin(), cause->units.end());
  units.insert(more.units.begin(), more.units.end());
  cause->units.assign(units.begin(), units.end());
  cause->all_units = cause->all_units || more.all_units;
}

void NameCauses(const Fit& fit, const Selection& selection, const DiagnoseOptions& options,
                Diagnosis* diagnosis) {
  std::vector<CauseFound>& causes = diagnosis->causes;
  for (CauseFound& cause : EventCauses(fit))
    if (!IsLeftOut(options, cause.cause)) causes.push_back(std::move(cause));
  for (UnknownFound& step : UnexplainedSteps(fit)) diagnosis->unknown.push_back(std::move(step));
  const double rms_um = RmsOf(fit);
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t)
    causes.push_back(CauseOf(fit, fit.model.terms[t], selection.accepted[t], rms_um));
  options.progress(0.8, "geometry against the table");
  for (CauseFound& cause : FindGeometryCauses(fit, options.family_wise)) {
    cause.predicted_gain_um = std::hypot(rms_um, cause.size_um) - rms_um;
    if (!IsLeftOut(options, cause.cause)) causes.push_back(std::move(cause));
  }
  MergeCauses(&causes);
  // Steps of the image are a misfit of its motion where that follows a column.
  if (std::any_of(diagnosis->unknown.begin(), diagnosis->unknown.end(),
                  [](const UnknownFound& reported) { return reported.channel == kImageShift; }))
    std::erase_if(causes,
                  [](const CauseFound& cause) { return TraitsOf(cause.cause).is_of_camera; });
}

}  // namespace focalfleet::sim
