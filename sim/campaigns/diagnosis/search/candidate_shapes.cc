#include "sim/campaigns/diagnosis/search/candidate_shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

namespace focalfleet::sim {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool DifferInShapeAlone(const Template& a, const Template& b) {
  const auto key = [](const Template& t) {
    return std::make_tuple(t.effect, t.axis, t.memory, t.form, t.columns);
  };
  return key(a) == key(b);
}

bool IsOfAll(const Template& form) { return form.shape_of_unit.empty(); }

// The distance to the nearest other shape of its kind. 0 where there is none, or none between them.
double GapTo(const Template& form, const Templates& kind) {
  double gap = kInfinity;
  for (const Template& other : kind)
    if (IsOfAll(other) && other.shape != form.shape)
      gap = std::min(gap, std::abs(other.shape - form.shape));
  return form.effect->continuous_shape && std::isfinite(gap) ? gap : 0;
}

Template Moved(const Template& form, double by) {
  Template moved = form;
  if (IsOfAll(form)) moved = WithShape(form, form.shape + by);
  moved.between = true;
  for (auto& [unit, shape] : moved.shape_of_unit) shape += by;
  return moved;
}

// Chi-square that the unit's residuals gain by the template; 0 where no possible amplitude gains.
double ChiSquare(const Score& score, const Template& form, std::size_t unit) {
  const std::size_t c = form.columns;
  const auto size = static_cast<Eigen::Index>(c);
  const Eigen::Map<const Eigen::VectorXd> b(score.b.data() + unit * c, size);
  const Eigen::Map<const Eigen::MatrixXd> g(score.g.data() + unit * c * c, size, size);
  if (!(g.trace() > 0) || IsImpossible(form, b, g)) return 0;
  return FitOwn(score, c, unit).chi_square;
}

Template BestOfAll(std::span<const Score> scores, std::span<const Template> tried,
                   const CampaignFacts& facts, const FleetGroups& groups) {
  double most = -kInfinity;
  std::size_t best = 0;
  for (std::size_t k = 0; k < tried.size(); ++k) {
    if (tried[k].shape <= 0 && tried[0].shape > 0) continue;
    if (!Shows(facts, tried[k])) continue;
    const double evidence = Assess(scores[k], tried[k], groups).log_evidence;
    if (evidence > most) most = evidence, best = k;
  }
  return tried[best];
}

Template BestOfEach(std::span<const Score> scores, std::span<const Template> tried,
                    const CampaignFacts& facts) {
  Template best = tried[0], one = tried[0];
  one.shape_of_unit.clear();
  const std::vector<CampaignUnit>& units = facts.campaign->units;
  for (std::size_t unit = 0; unit < units.size(); ++unit) {
    const auto own = best.shape_of_unit.find(units[unit].id);
    if (own == best.shape_of_unit.end()) continue;
    double most = 0;
    for (std::size_t k = 0; k < tried.size(); ++k) {
      const double chi_square = ChiSquare(scores[k], tried[k], unit);
      one.shape = tried[k].shape_of_unit.at(own->first);
      if (chi_square > most && Shows(facts, one)) most = chi_square, own->second = one.shape;
    }
  }
  return best;
}

}  // namespace

Templates KindOf(const Template& form, const Templates& library) {
  Templates kind;
  for (const Template& one : library)
    if (DifferInShapeAlone(form, one)) kind.push_back(one);
  return kind;
}

std::vector<CandidateShape> CandidateShapesOf(const ScorePass& pass,
                                              const std::vector<Evidence>& evidence_of,
                                              const Templates& templates, std::size_t best,
                                              double kept_min) {
  constexpr double kNear = 15, kNearShare = 0.15;  // of the best template's chi-square
  constexpr std::size_t kMost = 6;
  if (best == kNoTerm) return {};
  const double far = std::max(kNear, kNearShare * evidence_of[best].chi_square);
  std::map<std::pair<std::string_view, EffectAxis>, std::size_t> at_of;
  for (std::size_t k = 0; k < templates.size(); ++k) {
    if (evidence_of[k].log_evidence < evidence_of[best].log_evidence - far) continue;
    if (!(pass.scores[k].kept > kept_min * pass.scores[k].raw)) continue;
    const auto [it, fresh] =
        at_of.emplace(std::pair(templates[k].effect->cause, templates[k].axis), k);
    if (!fresh && evidence_of[k].log_evidence > evidence_of[it->second].log_evidence)
      it->second = k;
  }
  std::vector<std::size_t> order;
  for (const auto& [key, k] : at_of) order.push_back(k);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return evidence_of[a].log_evidence > evidence_of[b].log_evidence;
  });
  if (order.size() > kMost) order.resize(kMost);
  std::vector<CandidateShape> candidate_shapes;
  for (const std::size_t k : order) {
    const Template& form = templates[k];
    if (!IsOfAll(form)) continue;
    if (const double gap = GapTo(form, KindOf(form, templates)); gap > 0)
      candidate_shapes.push_back({form, gap});
  }
  return candidate_shapes;
}

std::vector<CandidateShape> OwnShapes(const ScorePass& pass, const Templates& templates,
                                      const CampaignFacts& facts, const FleetGroups& groups,
                                      double evidence_min) {
  const std::vector<CampaignUnit>& units = facts.campaign->units;
  std::vector<CandidateShape> candidate_shapes;
  std::vector<char> seen(templates.size(), 0);
  for (std::size_t first = 0; first < templates.size(); ++first) {
    if (!templates[first].effect->own_shape || seen[first] != 0) continue;
    Templates kind;
    std::vector<const Score*> scores;
    for (std::size_t k = first; k < templates.size(); ++k) {
      if (!DifferInShapeAlone(templates[first], templates[k])) continue;
      seen[k] = 1;
      if (!IsOfAll(templates[k]) || templates[k].between) continue;
      kind.push_back(templates[k]);
      scores.push_back(&pass.scores[k]);
    }
    if (kind.size() < 2) continue;
    std::map<std::uint32_t, double> shapes;
    Score own = *scores.front();  // each unit's by its own shape
    // The trace of the right shape is spread about a wrong one: the least spread is that of the
    // noise.
    for (const Score* one : scores)
      if (one->spread_sum * own.spread_count < own.spread_sum * one->spread_count)
        own.spread_sum = one->spread_sum, own.spread_count = one->spread_count;
    const std::size_t c = kind.front().columns;
    for (std::size_t unit = 0; unit < units.size(); ++unit) {
      const auto at_b = static_cast<std::ptrdiff_t>(unit * c);
      const auto at_g = static_cast<std::ptrdiff_t>(unit * c * c);
      std::fill_n(own.b.begin() + at_b, c, 0.0);
      std::fill_n(own.g.begin() + at_g, c * c, 0.0);
      double most = 0;
      for (std::size_t k = 0; k < kind.size(); ++k) {
        const double chi_square = ChiSquare(*scores[k], kind[k], unit);
        if (chi_square <= most) continue;
        most = chi_square;
        shapes[units[unit].id] = kind[k].shape;
        std::copy_n(scores[k]->b.begin() + at_b, c, own.b.begin() + at_b);
        std::copy_n(scores[k]->g.begin() + at_g, c * c, own.g.begin() + at_g);
      }
    }
    if (shapes.empty()) continue;
    auto choices = static_cast<double>(kind.size());
    for (const Template& one : kind) choices = std::max(choices, one.choices);
    Template form = WithShapes(kind.front(), std::move(shapes));
    form.choices = choices;
    if (Assess(own, form, groups).log_evidence > evidence_min)
      candidate_shapes.push_back({std::move(form), GapTo(kind.front(), kind)});
  }
  return candidate_shapes;
}

void RefineCandidateShapes(const Fit& fit, const FleetGroups& groups,
                           std::vector<CandidateShape>* candidate_shapes) {
  constexpr int kHalvings = 4;
  constexpr std::size_t kTried = 3;
  std::vector<CandidateShape*> refined;
  for (CandidateShape& one : *candidate_shapes)
    if (one.gap > 0) refined.push_back(&one);
  for (int halving = 0; halving < kHalvings && !refined.empty(); ++halving) {
    Templates tried;
    for (CandidateShape* one : refined) {
      one->gap /= 2;
      for (const double by : {0.0, -one->gap, one->gap}) tried.push_back(Moved(one->form, by));
    }
    const ScorePass pass = ScoreTemplates(fit, tried);
    for (std::size_t c = 0; c < refined.size(); ++c) {
      const auto scores = std::span(pass.scores).subspan(kTried * c, kTried);
      const auto forms = std::span(std::as_const(tried)).subspan(kTried * c, kTried);
      Template& form = refined[c]->form;
      form = IsOfAll(form) ? BestOfAll(scores, forms, *fit.facts, groups)
                           : BestOfEach(scores, forms, *fit.facts);
    }
  }
}

}  // namespace focalfleet::sim
