#include "sim/campaigns/diagnosis/search/both_axes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "sim/campaigns/diagnosis/search/multi_start.h"
#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {
namespace {

// The best of a cause's templates on each axis.
struct AxisPair {
  std::size_t theta = kNoTerm, phi = kNoTerm;
  double log_evidence = 0;  // sum of both; what they share counts twice
};

void TakeBetter(std::size_t k, const std::vector<Evidence>& evidence_of, std::size_t* best) {
  if (*best == kNoTerm || evidence_of[k].log_evidence > evidence_of[*best].log_evidence) *best = k;
}

using PairsByCause = std::map<std::string_view, AxisPair>;

// The pairs of all causes that have a template on each axis.
PairsByCause AllPairs(const ScorePass& pass, const Templates& templates,
                      const std::vector<Evidence>& evidence_of, double kept_min) {
  PairsByCause by_cause;
  for (std::size_t k = 0; k < templates.size(); ++k) {
    if (!(pass.scores[k].kept > kept_min * pass.scores[k].raw)) continue;
    AxisPair& pair = by_cause[templates[k].effect->cause];
    if (templates[k].axis == EffectAxis::kTheta) TakeBetter(k, evidence_of, &pair.theta);
    if (templates[k].axis == EffectAxis::kPhi) TakeBetter(k, evidence_of, &pair.phi);
  }
  std::erase_if(by_cause, [](const auto& of_cause) {
    return of_cause.second.theta == kNoTerm || of_cause.second.phi == kNoTerm;
  });
  for (auto& [cause, pair] : by_cause)
    pair.log_evidence = evidence_of[pair.theta].log_evidence + evidence_of[pair.phi].log_evidence;
  return by_cause;
}

// The pairs of other causes that are worth a trial, the best first. The other axis' part of the
// effect is noise to either template, so that a pair's evidence may be next to nothing. The own
// cause's pair, or without one the term itself, gives the scale.
std::vector<AxisPair> PromisingPairs(const PairsByCause& pairs, const Templates& templates,
                                     const std::vector<Evidence>& evidence_of, const Effect* own) {
  constexpr double kNear = 0.5;  // of the own cause's evidence
  double log_evidence = 0;
  if (const auto of_own = pairs.find(own->cause); of_own != pairs.end())
    log_evidence = of_own->second.log_evidence;
  else
    for (std::size_t k = 0; k < templates.size(); ++k)
      if (templates[k].effect == own)
        log_evidence = std::max(log_evidence, evidence_of[k].log_evidence);
  std::vector<AxisPair> promising;
  for (const auto& [cause, pair] : pairs)
    if (cause != own->cause && pair.log_evidence > std::max(kNear * log_evidence, 0.0))
      promising.push_back(pair);
  std::ranges::stable_sort(promising, std::ranges::greater{}, &AxisPair::log_evidence);
  return promising;
}

// The fit with the pair in place of the shapes that `without` lacks.
PairTrial Tried(const Fit& fit, const Fit& without, const ModelTerm& theta, const ModelTerm& phi) {
  constexpr int kRounds = 3;
  PairTrial trial{.cause = theta.form.effect->cause, .fit = without};
  trial.fit.model.terms.push_back(theta);
  trial.fit.model.terms.push_back(phi);
  StepFit(&trial.fit);
  SettleFit(&trial.fit, kRounds);
  trial.behind = BetterBy(fit, trial.fit);
  // The trial explains more, before its price, than chance gives to its additional parameters.
  constexpr double kSigmas = 3, kNoiseOfNoise = 1.2;  // in all, and each: tails are heavy
  constexpr double kFew = 2;
  const double more = std::max(CountParameters(trial.fit) - CountParameters(fit), 0.0);
  const double explains = PriceOf(trial.fit) - PriceOf(fit) - trial.behind;
  trial.beyond_chance = explains > kNoiseOfNoise * (more + kSigmas * std::sqrt(2 * more));
  trial.behind_by_likelihood = more <= kFew ? -explains : trial.behind;
  return trial;
}

// The evidence with an amplitude of each unit, where the term's units may differ.
Evidence OfEachUnit(Evidence evidence, const ModelTerm& as) {
  evidence.sharing = Sharing::kUnit;
  evidence.scattered = false, evidence.spread = 0;
  for (std::size_t unit = 0; unit < evidence.has.size(); ++unit)
    evidence.has[unit] = as.group_of_unit[unit] == kNoGroup ? 0 : 1;
  return evidence;
}

std::vector<PairTrial> TryAgainst(const Fit& fit, const Fit& without, const ModelTerm& term,
                                  const ScorePass& pass, const Templates& templates,
                                  const std::vector<Evidence>& evidence_of,
                                  const FleetGroups& groups, double kept_min) {
  constexpr std::size_t kMost = 6;
  std::vector<PairTrial> trials;
  for (const AxisPair& pair : PromisingPairs(AllPairs(pass, templates, evidence_of, kept_min),
                                             templates, evidence_of, term.form.effect)) {
    if (trials.size() >= kMost) break;
    const Evidence &theta = evidence_of[pair.theta], &phi = evidence_of[pair.phi];
    const auto take = [&](const Evidence& on_theta, const Evidence& on_phi) {
      trials.push_back(Tried(fit, without, MakeTerm(templates[pair.theta], on_theta, groups),
                             MakeTerm(templates[pair.phi], on_phi, groups)));
      trials.back().log_p = std::max(theta.log_p, phi.log_p);
    };
    take(theta, phi);
    // Either axis alone may show too little of its units to get amplitudes of each.
    if (term.sharing == Sharing::kUnit &&
        (theta.sharing != Sharing::kUnit || phi.sharing != Sharing::kUnit))
      take(OfEachUnit(theta, term), OfEachUnit(phi, term));
  }
  return trials;
}

}  // namespace

std::vector<PairTrial> TryPairs(const Fit& fit, std::size_t term, const ScorePass& pass,
                                const Templates& templates,
                                const std::vector<Evidence>& evidence_of, const FleetGroups& groups,
                                double kept_min) {
  const ModelTerm& own = fit.model.terms[term];
  if (own.form.axis != EffectAxis::kBoth) return {};
  // Two shapes of one cause may stand for one shape of another.
  Fit without = fit;
  const bool was_alone =
      std::erase_if(without.model.terms, [&](const ModelTerm& other) {
        return other.form.effect == own.form.effect && other.form.axis == own.form.axis;
      }) == 1;
  UpdateResiduals(&without);
  if (was_alone)
    return TryAgainst(fit, without, own, pass, templates, evidence_of, groups, kept_min);
  const ScorePass anew = ScoreTemplates(without, templates);
  std::vector<Evidence> assessed(templates.size());
  for (std::size_t k = 0; k < templates.size(); ++k)
    assessed[k] = Assess(anew.scores[k], templates[k], groups);
  return TryAgainst(fit, without, own, anew, templates, assessed, groups, kept_min);
}

}  // namespace focalfleet::sim
