#include "sim/campaigns/diagnosis/search/select.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string_view>
#include <tuple>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/search/both_axes.h"
#include "sim/campaigns/diagnosis/search/candidate_shapes.h"
#include "sim/campaigns/diagnosis/search/quick_look.h"
#include "sim/campaigns/diagnosis/search/some_units.h"

namespace focalfleet::sim {
namespace {

constexpr double kKeptMin = 0.03;  // of a signature: geometry explains a smaller rest as well
// A rival that leaves the same trace may be so many times as far behind.
constexpr double kAlike = 4;
constexpr double kShapeDoubt = 0.002;
constexpr double kHopeless = 0.3;  // of what the term explains
constexpr int kSwapSweepsMax = 3;
constexpr double kBetterBy = 0.5;  // log evidence

// `library`: the templates are some or all of it.
std::vector<Evidence> AssessAll(const ScorePass& pass, const Templates& templates,
                                const Templates& library, const FleetGroups& groups,
                                const ParallelFor& parallel, const NoiseLevel& noise) {
  std::vector<Evidence> evidence_of(templates.size());
  constexpr std::size_t kBlock = 16;
  const std::size_t blocks = (templates.size() + kBlock - 1) / kBlock;
  parallel(blocks, [&](std::size_t block) {
    const std::size_t end = std::min(templates.size(), (block + 1) * kBlock);
    for (std::size_t k = block * kBlock; k < end; ++k)
      evidence_of[k] = Assess(pass.scores[k], templates[k], groups, noise);
  });
  // Causes are equally likely on each of their axes, and shapes have their share of the cause: one
  // with many shapes fits by chance more often.
  std::map<std::pair<std::string_view, EffectAxis>, double> shapes;
  for (const Template& form : library) shapes[{form.effect->cause, form.axis}] += 1;
  for (std::size_t k = 0; k < templates.size(); ++k)
    evidence_of[k].log_evidence -=
        std::log(shapes[{templates[k].effect->cause, templates[k].axis}]) +
        std::log(static_cast<double>(shapes.size()));
  return evidence_of;
}

// Templates that leave the same trace tie: the name decides, not the order of the library.
bool ComesFirst(const Template& a, const Template& b) {
  const auto key = [](const Template& t) {
    return std::make_tuple(t.effect->cause, t.axis, t.memory, t.form, t.shape,
                           std::string_view(t.covariate), std::cref(t.shape_of_unit));
  };
  return key(a) < key(b);
}

Best BestOf(const ScorePass& pass, const Templates& templates,
            const std::vector<Evidence>& evidence_of, double tests, double family_wise,
            double kept_min = kKeptMin) {
  constexpr double kTie = 1e-6;
  Best best;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < evidence_of.size(); ++k) {
    const Score& score = pass.scores[k];
    if (!(score.kept > kept_min * score.raw)) continue;
    const double log_p = LogLeastOf(evidence_of[k].log_p, tests);
    if (log_p > std::log(family_wise) || evidence_of[k].log_evidence < most - kTie) continue;
    if (best.at != kNoTerm && evidence_of[k].log_evidence < most + kTie &&
        !ComesFirst(templates[k], templates[best.at]))
      continue;
    if (std::ranges::none_of(evidence_of[k].has, [](char h) { return h != 0; })) continue;
    // More likely than not: what chance reaches in one of a hundred campaigns may be less.
    if (evidence_of[k].log_evidence <= 0) continue;
    most = evidence_of[k].log_evidence;
    best = {k, evidence_of[k], log_p};
  }
  return best;
}

bool SameForm(const Template& a, const Template& b) {
  return a.effect == b.effect && a.axis == b.axis && a.memory == b.memory && a.form == b.form &&
         a.shape == b.shape && a.shape_of_unit == b.shape_of_unit && a.covariate == b.covariate;
}

std::size_t IndexOf(const Templates& templates, const Template& form) {
  for (std::size_t k = 0; k < templates.size(); ++k)
    if (SameForm(templates[k], form)) return k;
  return kNoTerm;
}

// Amplitudes are linear: two rounds of noise, weights and step suffice.
void RefitTerms(Fit* fit) { SettleFit(fit, 2); }

struct Look {
  ScorePass pass;
  std::vector<Evidence> evidence_of;
};

// Looks at one state of the fit, with all of its terms (kNoTerm) and without each. All are made at
// the first request, because the signatures are the same in all.
class LookBook {
 public:
  /// `one_by_one`: only requested looks are made.
  LookBook(const FleetGroups& groups, bool one_by_one) : groups_(groups), one_by_one_(one_by_one) {}

  const Look& At(const Fit& fit, const Templates& templates, std::size_t without) {
    if (looks_.find(without) == looks_.end()) Open(fit, templates, without);
    Look& look = looks_.at(without);
    if (look.evidence_of.empty())
      look.evidence_of = AssessAll(look.pass, templates, templates, groups_, fit.parallel, noise_);
    return look;
  }
  /// The level in the last state looked at.
  [[nodiscard]] const NoiseLevel& noise() const { return noise_; }
  /// Call after a change of the fit or the templates.
  void Forget() { looks_.clear(); }

 private:
  void Open(const Fit& fit, const Templates& templates, std::size_t without) {
    std::vector<std::size_t> withouts = {without};
    if (!one_by_one_) {
      withouts = {kNoTerm};
      for (std::size_t t = 0; t < fit.model.terms.size(); ++t) withouts.push_back(t);
    }
    std::vector<ScorePass> passes = ScoreWithouts(fit, templates, withouts);
    // The signal of a left-out term is no noise.
    noise_ =
        withouts[0] == kNoTerm ? LevelOf(passes[0].scores, templates, fit.parallel) : NoiseLevel{};
    for (std::size_t k = 0; k < withouts.size(); ++k)
      looks_[withouts[k]].pass = std::move(passes[k]);
  }

  const FleetGroups& groups_;
  bool one_by_one_;
  std::map<std::size_t, Look> looks_;
  NoiseLevel noise_;  // of the state of the fit
};

// The best of the templates from `begin` on and the best of those before.
Best BestAmong(const Fit& fit, const Templates& templates, const FleetGroups& groups,
               const NoiseLevel& noise, std::size_t begin, const Best& before, double tests,
               double family_wise) {
  const Templates refined(templates.begin() + static_cast<std::ptrdiff_t>(begin), templates.end());
  const ScorePass pass = ScoreTemplates(fit, refined);
  const std::vector<Evidence> evidence_of =
      AssessAll(pass, refined, templates, groups, fit.parallel, noise);
  Best best = BestOf(pass, refined, evidence_of, tests, family_wise);
  if (best.at == kNoTerm || best.evidence.log_evidence <= before.evidence.log_evidence)
    return before;
  best.at += begin;
  return best;
}

void DropTerm(std::size_t at, Fit* fit) {
  fit->model.terms.erase(fit->model.terms.begin() + static_cast<std::ptrdiff_t>(at));
  StepFit(fit);
  RefitTerms(fit);
}

std::vector<Rival> RivalsOf(const Look& look, const Templates& templates, const FleetGroups& groups,
                            std::size_t own, const SelectionRule& rule) {
  std::map<std::string_view, Rival> by_cause;
  const Evidence& best = look.evidence_of[own];
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const std::string_view cause = templates[k].effect->cause;
    if (cause == templates[own].effect->cause) continue;
    // A rival may be what geometry explains for the most part: its size is no reason against it.
    if (!(look.pass.scores[k].kept > 0)) continue;
    const double behind = 2 * (best.log_evidence - look.evidence_of[k].log_evidence);
    const double share =
        ShareOfTarget(look.pass.scores[k], templates[k], best, groups, look.pass.target_square);
    const bool hopeless = behind > kHopeless * best.chi_square;  // its amplitude is impossible
    // Signatures are as good as their shapes: of a large cause a small share decides nothing.
    const double near = std::max(rule.rival_behind, kShapeDoubt * best.chi_square);
    const bool alike = share >= rule.rival_share && !hopeless &&
                       AreTogether(templates[k].effect->owner, best.has, groups);
    if (behind >= (alike ? kAlike : 1) * near) continue;
    const double log_odds = -behind / 2 * rule.rival_behind / near;
    const Rival rival{cause, behind, log_odds, share};
    const auto [it, fresh] = by_cause.emplace(cause, rival);
    if (!fresh && behind < it->second.behind) it->second = rival;
  }
  std::vector<Rival> rivals;
  for (const auto& [cause, rival] : by_cause) rivals.push_back(rival);
  return rivals;
}

// Exchanges a cause of both axes for one with its own amplitude on each, if that is better.
bool ExchangeForPair(const Look& look, const Templates& templates, const FleetGroups& groups,
                     const SelectionRule& rule, double tests, std::size_t at, Fit* fit) {
  if (fit->model.terms.size() >= rule.terms_max) return false;
  std::vector<PairTrial> trials =
      TryPairs(*fit, at, look.pass, templates, look.evidence_of, groups, kKeptMin);
  std::erase_if(trials, [&](const PairTrial& trial) {
    return LogLeastOf(trial.log_p, tests) > std::log(rule.family_wise);
  });
  const auto best = std::ranges::min_element(trials, {}, &PairTrial::behind);
  if (best == trials.end() || best->behind >= -2 * kBetterBy) return false;
  *fit = std::move(best->fit);
  return true;
}

// Adds pairs that do as well as a term of both axes, with a cause on each, as rivals.
void AddPairsAsRivals(const Look& look, const Templates& templates, const FleetGroups& groups,
                      const SelectionRule& rule, const Fit& fit, std::size_t at,
                      std::vector<Rival>* rivals) {
  for (const PairTrial& trial :
       TryPairs(fit, at, look.pass, templates, look.evidence_of, groups, kKeptMin))
    if ((std::min(trial.behind, trial.behind_by_likelihood) < rule.rival_behind ||
         trial.beyond_chance) &&
        std::ranges::find(*rivals, trial.cause, &Rival::cause) == rivals->end())
      rivals->push_back({trial.cause, trial.behind, -trial.behind / 2, 0, true});
}

// Looks at each term once: exchanges it, drops it, or keeps its rivals. True if anything changed.
bool SwapSweep(const Templates& templates, const FleetGroups& groups, const SelectionRule& rule,
               double tests, LookBook* looks, Fit* fit, std::vector<Accepted>* accepted) {
  accepted->clear();
  bool changed = false;
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t) {
    const Look& look = looks->At(*fit, templates, t);
    const Best best = BestOf(look.pass, templates, look.evidence_of, tests, rule.family_wise);
    if (best.at == kNoTerm) {
      looks->Forget();
      DropTerm(t, fit);
      return true;
    }
    const std::size_t own = IndexOf(templates, fit->model.terms[t].form);
    const bool better =
        best.at != own && (own == kNoTerm || best.evidence.log_evidence >
                                                 look.evidence_of[own].log_evidence + kBetterBy);
    const bool other_level =
        best.at == own && (best.evidence.sharing != fit->model.terms[t].sharing);
    if (!better && ExchangeForPair(look, templates, groups, rule, tests, t, fit)) {
      looks->Forget();
      return true;
    }
    if (!better && !other_level) {
      accepted->push_back({look.evidence_of[own], RivalsOf(look, templates, groups, own, rule)});
      continue;
    }
    looks->Forget();
    fit->model.terms[t] = MakeTerm(templates[best.at], best.evidence, groups);
    StepFit(fit);
    RefitTerms(fit);
    changed = true;
  }
  return changed;
}

void TakeRivals(const Templates& templates, const FleetGroups& groups, const SelectionRule& rule,
                const Fit& fit, LookBook* looks, std::vector<Accepted>* accepted) {
  accepted->clear();
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const Look& look = looks->At(fit, templates, t);
    const std::size_t own = IndexOf(templates, fit.model.terms[t].form);
    accepted->push_back({look.evidence_of[own], RivalsOf(look, templates, groups, own, rule)});
  }
}

// Drops terms that the others have made needless, the weakest first.
void DropTheNeedless(const Templates& templates, const FleetGroups& groups,
                     const SelectionRule& rule, double tests, LookBook* looks, Fit* fit,
                     std::vector<Accepted>* accepted) {
  for (;;) {
    std::size_t weakest = kNoTerm;
    for (std::size_t t = 0; t < accepted->size(); ++t) {
      const double log_p = LogLeastOf((*accepted)[t].evidence.log_p, tests);
      if (log_p <= std::log(rule.family_wise)) continue;
      if (weakest == kNoTerm || log_p > LogLeastOf((*accepted)[weakest].evidence.log_p, tests))
        weakest = t;
    }
    if (weakest == kNoTerm) return;
    looks->Forget();
    DropTerm(weakest, fit);
    TakeRivals(templates, groups, rule, *fit, looks, accepted);
  }
}

}  // namespace

ModelTerm MakeTerm(const Template& form, const Evidence& evidence, const FleetGroups& groups) {
  ModelTerm term;
  term.form = form;
  term.sharing = evidence.sharing;
  const std::size_t units = evidence.has.size();
  std::size_t count = 1;
  term.group_of_unit.assign(units, 0);
  if (evidence.sharing == Sharing::kUnit) {
    std::iota(term.group_of_unit.begin(), term.group_of_unit.end(), 0u);
    count = units;
  } else if (evidence.sharing == Sharing::kRail) {
    term.group_of_unit = groups.rail, count = groups.rails;
  } else if (evidence.sharing == Sharing::kBus) {
    term.group_of_unit = groups.bus, count = groups.buses;
  }
  for (std::size_t unit = 0; unit < units; ++unit)
    if (evidence.has[unit] == 0) term.group_of_unit[unit] = kNoGroup;
  term.amplitude.assign(count * form.columns, 0);
  term.sigma.assign(count * form.columns, 0);
  // The evidence's size is a grid point, so that the prior is made loose.
  if (evidence.sharing == Sharing::kUnit && units > 1) term.spread = 3 * evidence.spread;
  term.has_mean = evidence.scattered;
  return term;
}

Best FindBest(const ScorePass& pass, const Templates& templates, const FleetGroups& groups,
              const ParallelFor& parallel, double tests, double family_wise, double kept_min) {
  const NoiseLevel noise = LevelOf(pass.scores, templates, parallel);
  return BestOf(pass, templates, AssessAll(pass, templates, templates, groups, parallel, noise),
                tests, family_wise, kept_min);
}

std::vector<Rival> FindRivals(const Templates& templates, const SelectionRule& rule, const Fit& fit,
                              std::size_t term) {
  Templates tried = templates;
  const Template& form = fit.model.terms[term].form;
  if (IndexOf(tried, form) == kNoTerm) tried.push_back(form);
  const FleetGroups groups = GroupsOf(*fit.facts);
  LookBook looks(groups, true);
  return RivalsOf(looks.At(fit, tried, term), tried, groups, IndexOf(tried, form), rule);
}

namespace {

// Adds the best template, with the shape that suits it. False: chance explains what is left.
bool AddTerm(const FleetGroups& groups, const SelectionRule& rule, Templates* templates,
             LookBook* looks, Fit* fit, Selection* selection) {
  rule.progress("signatures");
  const bool full = fit->model.terms.size() >= rule.terms_max;
  if (!full)
    for (Template& form : WorthAScore(*fit, *templates))
      if (IndexOf(*templates, form) == kNoTerm)
        templates->push_back(std::move(form)), looks->Forget();
  const Look& look = looks->At(*fit, *templates, kNoTerm);
  if (selection->kept_share.empty()) {
    selection->tests = EffectiveTests(look.pass.scores, *templates, rule.seed);
    for (const Score& score : look.pass.scores)
      selection->kept_share.push_back(score.raw > 0 ? score.kept / score.raw : 0);
  }
  if (full) return false;
  Best best = BestOf(look.pass, *templates, look.evidence_of, selection->tests, rule.family_wise);
  const std::size_t listed = templates->size();
  const NoiseLevel noise = looks->noise();
  std::vector<CandidateShape> candidate_shapes =
      CandidateShapesOf(look.pass, look.evidence_of, *templates, best.at, kKeptMin);
  // Evidence may grow where each unit's shape is refined, too.
  constexpr double kOfBest = 0.3;
  const double least = best.at == kNoTerm ? 0 : kOfBest * best.evidence.log_evidence;
  for (CandidateShape& own : OwnShapes(look.pass, *templates, *fit->facts, groups, least))
    candidate_shapes.push_back(std::move(own));
  looks->Forget();
  RefineCandidateShapes(*fit, groups, &candidate_shapes);
  for (CandidateShape& one : candidate_shapes)
    if (IndexOf(*templates, one.form) == kNoTerm) templates->push_back(std::move(one.form));
  if (templates->size() > listed)
    best = BestAmong(*fit, *templates, groups, noise, listed, best, selection->tests,
                     rule.family_wise);
  if (best.at == kNoTerm) return false;
  const CampaignModel before = fit->model;
  fit->model.terms.push_back(MakeTerm((*templates)[best.at], best.evidence, groups));
  StepFit(fit);
  RefitTerms(fit);
  if (SizeOf(*fit, fit->model.terms.back()) >= rule.size_min_um) return true;
  fit->model = before;
  UpdateResiduals(fit);
  RefitTerms(fit);
  return false;
}

Selection SelectByAll(const Templates& library, const SelectionRule& rule, Fit* fit) {
  Templates templates = library;  // and refined ones, and those of the model
  for (const ModelTerm& term : fit->model.terms)
    if (IndexOf(templates, term.form) == kNoTerm) templates.push_back(term.form);
  const FleetGroups groups = GroupsOf(*fit->facts);
  LookBook looks(groups, false);
  Selection selection;
  for (std::size_t round = 0;
       round < rule.terms_max && AddTerm(groups, rule, &templates, &looks, fit, &selection);
       ++round) {
    if (fit->model.terms.size() < 2) continue;
    rule.progress("exchanges");
    for (int sweep = 0; sweep < kSwapSweepsMax; ++sweep)
      if (!SwapSweep(templates, groups, rule, selection.tests, &looks, fit, &selection.accepted))
        break;
  }
  rule.progress("rivals");
  bool rests = selection.accepted.size() == fit->model.terms.size() && fit->model.terms.size() > 1;
  for (int sweep = 0; !rests && sweep < kSwapSweepsMax; ++sweep)
    rests = !SwapSweep(templates, groups, rule, selection.tests, &looks, fit, &selection.accepted);
  if (!rests) TakeRivals(templates, groups, rule, *fit, &looks, &selection.accepted);
  DropTheNeedless(templates, groups, rule, selection.tests, &looks, fit, &selection.accepted);
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t)
    if (fit->model.terms[t].form.axis == EffectAxis::kBoth)
      AddPairsAsRivals(looks.At(*fit, templates, t), templates, groups, rule, *fit, t,
                       &selection.accepted[t].rivals);
  return selection;
}

// The model's own templates, and those of the causes that may be rivals: of terms with rivals
// already, these. A term without them was found since, and may have any.
Templates NearTemplates(const Templates& library, const std::vector<Accepted>& accepted,
                        const Fit& fit) {
  Templates near;
  for (const ModelTerm& term : fit.model.terms)
    if (IndexOf(near, term.form) == kNoTerm) near.push_back(term.form);
  const bool may_be_any = accepted.size() < fit.model.terms.size();
  std::set<std::string_view> causes;
  for (const Accepted& one : accepted)
    for (const Rival& rival : one.rivals) causes.insert(rival.cause);
  for (const Template& form : library)
    if ((may_be_any || causes.contains(form.effect->cause)) && IndexOf(near, form) == kNoTerm)
      near.push_back(form);
  return near;
}

// Pairs of causes are tried among some units alone, as each trial is a fit. Those that did as well
// as a term stay its rivals.
void KeepPairs(const std::vector<ModelTerm>& terms_before, const std::vector<Accepted>& before,
               const Fit& fit, std::vector<Accepted>* accepted) {
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const Template& form = fit.model.terms[t].form;
    std::vector<Rival>& rivals = (*accepted)[t].rivals;
    for (std::size_t b = 0; b < before.size(); ++b) {
      const Template& was = terms_before[b].form;
      if (was.effect != form.effect || was.axis != form.axis) continue;
      for (const Rival& rival : before[b].rivals)
        if (rival.of_pair && std::ranges::find(rivals, rival.cause, &Rival::cause) == rivals.end())
          rivals.push_back(rival);
    }
  }
}

}  // namespace

Selection Select(const Templates& library, const SelectionRule& rule, Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  if (campaign.rows() <= rule.rows_many) return SelectByAll(library, rule, fit);
  const std::size_t keep = campaign.units.size() * rule.rows_kept / campaign.rows();
  Fit some = SomeUnits(*fit, keep, rule.seed);
  Selection selection = SelectByAll(library, rule, &some);
  const std::vector<Accepted> of_some = selection.accepted;
  fit->model.terms = some.model.terms;
  for (ModelTerm& term : fit->model.terms) SpreadToAll(some, &term);
  const FleetGroups groups = GroupsOf(*fit->facts);
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t)
    if (!fit->model.terms[t].form.shape_of_unit.empty()) GiveShapes(library, groups, t, fit);
  StepFit(fit);
  RefitTerms(fit);
  // Effects that only units have that were not examined.
  rule.progress("all units");
  Templates templates = library;
  LookBook of_library(groups, true);
  while (AddTerm(groups, rule, &templates, &of_library, fit, &selection)) {
  }
  of_library.Forget();
  rule.progress("rivals of all units");
  const Templates near = NearTemplates(templates, selection.accepted, *fit);
  LookBook of_near(groups, false);
  TakeRivals(near, groups, rule, *fit, &of_near, &selection.accepted);
  DropTheNeedless(near, groups, rule, selection.tests, &of_near, fit, &selection.accepted);
  KeepPairs(some.model.terms, of_some, *fit, &selection.accepted);
  return selection;
}

}  // namespace focalfleet::sim
