#include "sim/campaigns/diagnosis/design/next_moves.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>

#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/score/evidence.h"
#include "sim/campaigns/diagnosis/score/score.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Whether effects of the two axes can touch each other: "both" and "none" touch all.
bool AxesMeet(std::string_view a, std::string_view b) {
  const auto open = [](std::string_view axis) { return axis == "both" || axis == "none"; };
  return a == b || open(a) || open(b);
}

constexpr std::size_t kPairsMax = 12;
constexpr std::size_t kUnitsOfCause = 8;   // units that a cause is examined in
constexpr std::size_t kUnitsOfGroup = 40;  // where units act on each other
constexpr std::size_t kRowsMax = 4000;     // moves already made
constexpr std::size_t kFormsOfRival = 6;   // the rival's nearest shapes
constexpr double kSure = 38;               // D at which a pair is separated
constexpr double kWorthALook = 0.002;      // probability of confusion, summed over the pairs
constexpr double kTurn_s = 33;             // time of a move of one axis
constexpr double kExposure_s = 10, kHoming_s = 60;
constexpr double kLever_s = 20, kTelescope_s = 40;  // to change the drive; the elevation
constexpr double kDelayMin_s = 3;                   // a shorter delay saves nothing

// The stance in which all blocks of moves begin and end.
const ProposedMove& Home() {
  static const ProposedMove home{.theta_fp_deg = 0, .phi_fp_deg = 90};
  return home;
}

// ---- Pairs of causes to separate.

// A cause of the model and a rival that could be it.
struct Pair {
  std::size_t term = 0;
  std::string cause, rival;
  Templates forms;   // of the rival
  double scale = 1;  // ratio of D in all units to D in the examined ones
};

// The term of this name with the largest effect.
std::optional<std::size_t> TermOf(const Fit& fit, const CauseFound& cause) {
  std::optional<std::size_t> strongest;
  double most_um = 0;
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const ModelTerm& term = fit.model.terms[t];
    if (term.form.effect->cause != cause.cause || !AxesMeet(Name(term.form.axis), cause.axis))
      continue;
    const double size_um = SizeOf(fit, term);
    if (!strongest || size_um > most_um) strongest = t, most_um = size_um;
  }
  return strongest;
}

bool ActsOnOthers(const Effect& effect) {
  return effect.owner == Owner::kRail || effect.owner == Owner::kBus ||
         effect.traits.acts_on_others;
}

// Units that show the term most. Where units act on each other, those around the one that shows it
// most.
std::vector<std::size_t> UnitsOf(const Fit& fit, const ModelTerm& term, bool in_groups,
                                 const TermTrace& trace) {
  const std::vector<CampaignUnit>& units = fit.model.units;
  std::vector<std::size_t> order;
  for (std::size_t u = 0; u < units.size(); ++u)
    if (fit.UsesUnit(u) && term.group_of_unit[u] != kNoGroup) order.push_back(u);
  const auto more = [&](std::size_t a, std::size_t b) {
    return trace.square_um2[a] != trace.square_um2[b] ? trace.square_um2[a] > trace.square_um2[b]
                                                      : a < b;
  };
  std::ranges::sort(order, more);
  std::size_t most = kUnitsOfCause;
  if (in_groups && !order.empty()) {
    const CampaignUnit& first = units[order.front()];
    const auto far_mm = [&](std::size_t u) {
      const bool elsewhere = std::isfinite(first.rail) && units[u].rail != first.rail;
      return (elsewhere ? 1e6 : 0) +
             std::hypot(units[u].base_x_mm - first.base_x_mm, units[u].base_y_mm - first.base_y_mm);
    };
    std::ranges::stable_sort(order, {}, far_mm);
    most = kUnitsOfGroup;
  }
  if (order.size() > most) order.resize(most);
  return order;
}

// ---- A fit of some units, with moves to come.

struct Ground {
  Campaign made;
  std::vector<ModelTerm> terms;  // terms of the model that these units and columns can have
  std::vector<double> weight;    // Shape: (rows of made)
};

Ground GroundOf(const Fit& fit, const std::set<std::size_t>& units) {
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t of_each = kRowsMax / std::max<std::size_t>(units.size(), 1);
  std::vector<bool> keep(campaign.rows(), false);
  Ground ground;
  for (const std::size_t u : units) {
    const std::size_t begin = campaign.first_row[u], end = campaign.first_row[u + 1];
    for (std::size_t row = std::max(begin, end > of_each ? end - of_each : 0); row < end; ++row)
      keep[row] = true;
  }
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    if (keep[row]) ground.weight.push_back(fit.weight[row]);
  ground.made = Keep(campaign, keep);
  return ground;
}

// Few units may have no gradient between them, or no neighbours: terms of such columns stay out.
void TakeTerms(const Fit& fit, Ground* ground, std::vector<Pair>* pairs, NextMoves* out) {
  const Campaign campaign = Ahead(ground->made, SpreadOver(ground->made.units, {Home()}));
  const CampaignFacts facts = MakeFacts(campaign);
  std::vector<std::size_t> place(fit.model.terms.size(), kNoTerm);
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t)
    if (IsOffered(fit.model.terms[t].form, facts)) {
      place[t] = ground->terms.size();
      ground->terms.push_back(fit.model.terms[t]);
    }
  for (Pair& pair : *pairs) {
    pair.term = place[pair.term];
    if (pair.term == kNoTerm) out->inseparable.push_back({pair.cause, pair.rival});
  }
  std::erase_if(*pairs, [](const Pair& pair) { return pair.term == kNoTerm; });
}

// Owns the data that a fit refers to.
struct FitAhead {
  Campaign campaign;
  CampaignFacts facts;
  Fit fit;
};

// Residuals play no part here: only the effects of the terms count.
std::unique_ptr<FitAhead> LookAhead(const Fit& fit, const Ground& ground,
                                    const std::vector<ProposedMove>& moves) {
  auto ahead = std::make_unique<FitAhead>();
  ahead->campaign = Ahead(ground.made, SpreadOver(ground.made.units, moves));
  ahead->facts = MakeFacts(ahead->campaign);
  ahead->fit.facts = &ahead->facts;
  ahead->fit.model.units = fit.model.units;
  ahead->fit.model.terms = ground.terms;
  ahead->fit.noise = fit.noise;
  ahead->fit.noise.exposure_factor.clear();
  ahead->fit.parallel = OneAfterTheOther();
  const std::size_t rows = ahead->campaign.rows();
  ahead->fit.x_um.assign(rows, 0), ahead->fit.y_um.assign(rows, 0);
  ahead->fit.aside.assign(rows, 0);
  const Campaign& made = ground.made;
  for (std::size_t u = 0; u < made.units.size(); ++u) {
    const std::size_t count = made.first_row[u + 1] - made.first_row[u];
    if (count == 0) continue;
    const auto begin = ground.weight.begin() + static_cast<std::ptrdiff_t>(made.first_row[u]);
    ahead->fit.weight.insert(ahead->fit.weight.end(), begin,
                             begin + static_cast<std::ptrdiff_t>(count));
    ahead->fit.weight.insert(ahead->fit.weight.end(), moves.size(), 1);
  }
  return ahead;
}

// For each form, what it leaves of the term's own signal, as a chi-square.
std::vector<double> LeftBy(const Fit& ahead, const FleetGroups& groups, std::size_t term,
                           const Templates& forms) {
  const ScorePass pass = ScoreTemplates(ahead, forms, term);
  const Evidence as{.sharing = ahead.model.terms[term].sharing};
  std::vector<double> left;
  for (std::size_t k = 0; k < forms.size(); ++k)
    left.push_back(pass.target_square *
                   (1 - ShareOfTarget(pass.scores[k], forms[k], as, groups, pass.target_square)));
  return left;
}

// The rival's shapes that leave least of the term, with the moves that were made.
Templates NearestForms(const Fit& ahead, const FleetGroups& groups, std::size_t term,
                       std::string_view rival) {
  const Effect* effect = FindEffect(rival);
  if (effect == nullptr) return {};
  Templates forms = ListTemplates(*effect, *ahead.facts);
  const std::string_view axis = Name(ahead.model.terms[term].form.axis);
  std::erase_if(forms, [&](const Template& form) { return !AxesMeet(Name(form.axis), axis); });
  if (forms.empty()) return {};
  const std::vector<double> left = LeftBy(ahead, groups, term, forms);
  std::vector<std::size_t> order(forms.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return left[k]; });
  Templates nearest;
  for (std::size_t k = 0; k < std::min(order.size(), kFormsOfRival); ++k)
    nearest.push_back(forms[order[k]]);
  return nearest;
}

std::vector<double> Apart(const Fit& ahead, const FleetGroups& groups,
                          const std::vector<Pair>& pairs) {
  std::vector<double> d;
  for (const Pair& pair : pairs) {
    const std::vector<double> left = LeftBy(ahead, groups, pair.term, pair.forms);
    d.push_back(pair.scale * std::max(*std::ranges::min_element(left), 0.0));
  }
  return d;
}

// ---- Moves that are possible.

// Moves that end in the stance that they begin in: blocks can follow each other in any order.
struct MoveBlock {
  std::vector<ProposedMove> moves;
  double seconds = 0;
};

double SecondsOf(const std::vector<ProposedMove>& moves) {
  ProposedMove at = Home();
  double seconds = 0;
  for (const ProposedMove& move : moves) {
    const double way_deg = std::max(std::abs(move.theta_fp_deg - at.theta_fp_deg),
                                    std::abs(move.phi_fp_deg - at.phi_fp_deg));
    const MoveConditions& conditions = move.conditions;
    seconds += way_deg / 360 * kTurn_s + kExposure_s + std::max(conditions.delay_s, kDelayMin_s);
    if (conditions.home_first) seconds += kHoming_s;
    if (conditions.drive_amplitude != 1) seconds += kLever_s;
    if (std::isfinite(conditions.elevation_deg)) seconds += kTelescope_s;
    at = move;
  }
  return seconds;
}

void Add(std::vector<ProposedMove> moves, std::vector<MoveBlock>* blocks) {
  const double seconds = SecondsOf(moves);
  blocks->push_back({std::move(moves), seconds});
}

ProposedMove Off(ProposedMove lever, double theta_deg, double phi_deg) {
  lever.theta_fp_deg = Home().theta_fp_deg + theta_deg;
  lever.phi_fp_deg = Home().phi_fp_deg + phi_deg;
  return lever;
}

ProposedMove After(double delay_s) { return {.conditions = {.delay_s = delay_s}}; }

// Moves with each condition that these units allow.
std::vector<ProposedMove> LeversOf(const CampaignFacts& facts) {
  std::vector<ProposedMove> levers = {{}, {.conditions = {.home_first = true}}};
  for (const double drive : {0.6, 1.5})
    levers.push_back({.conditions = {.drive_amplitude = drive}});
  for (const double delay_s : {0.3, 30.0}) levers.push_back({.conditions = {.delay_s = delay_s}});
  if (facts.Has("elevation_deg"))
    for (const double elevation_deg : {20.0, 80.0})
      levers.push_back({.conditions = {.elevation_deg = elevation_deg}});
  if (facts.Has("movers_on_rail"))
    for (const std::size_t every : {std::size_t{4}, std::size_t{20}})
      levers.push_back({.every = every});
  return levers;
}

std::vector<MoveBlock> ListBlocks(const CampaignFacts& facts) {
  constexpr double kSteps_deg[][2] = {{0.15, 0.15}, {0.6, 0.6}, {2.5, 2.5},
                                      {10, 10},     {40, 40},   {140, 80}};
  std::vector<MoveBlock> blocks;
  for (const ProposedMove& lever : LeversOf(facts))
    for (const auto& step : kSteps_deg)
      for (const double sign : {1.0, -1.0})
        for (const auto& [theta, phi] : {std::pair(1.0, 0.0), {0.0, 1.0}, {1.0, 1.0}}) {
          ProposedMove back = lever;
          back.conditions.home_first = false;
          Add({Off(lever, sign * theta * step[0], sign * phi * step[1]), Off(back, 0, 0)}, &blocks);
        }
  for (const auto& [theta, phi] : {std::pair(1.0, 0.0), {0.0, 1.0}}) {
    // Short steps one way, and one back.
    for (const double step : {0.15, 0.6, 2.5, 8.0}) {
      std::vector<ProposedMove> stairs;
      for (int k = 1; k <= 5; ++k) stairs.push_back(Off({}, k * step * theta, k * step * phi));
      stairs.push_back(Off({}, 0, 0));
      Add(std::move(stairs), &blocks);
    }
    // An arc over the range.
    std::vector<ProposedMove> arc;
    const double reach = theta > 0 ? 150 : 80;
    for (int k = -5; k <= 5; ++k)
      arc.push_back(Off({}, k * reach / 5 * theta, k * reach / 5 * phi));
    arc.push_back(Off({}, 0, 0));
    Add(std::move(arc), &blocks);
    // Exposures at rest, repeated.
    for (const double step : {2.5, 40.0})
      Add({Off(After(0.3), step * theta, step * phi), Off(After(30), step * theta, step * phi),
           Off(After(100), step * theta, step * phi), Off(After(0.3), 0, 0)},
          &blocks);
  }
  return blocks;
}

// ---- The choice.

double ConfusionOf(const std::vector<double>& d) {
  double sum = 0;
  for (const double one : d) sum += ConfusionAt(one);
  return sum;
}

class Chooser {
 public:
  Chooser(const Fit& fit, const Ground& ground, const std::vector<Pair>& pairs)
      : fit_(fit), ground_(ground), groups_(GroupsOf(*fit.facts)), pairs_(pairs) {
    blocks_ = ListBlocks(*fit.facts);
    worth_.assign(blocks_.size(), 0);
    made_ = Apart(LookAhead(fit_, ground_, {})->fit, groups_, pairs_);
    d_.assign(pairs_.size(), 0);
  }

  NextMoves Choose() {
    std::vector<ProposedMove> moves = {Home()};
    std::vector<std::size_t> all(blocks_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    LookAt(all, moves);
    while (!AllSure()) {
      const std::size_t best = BestBlock(moves);
      if (best == kNoTerm || worth_[best] * blocks_[best].seconds < kWorthALook) break;
      const std::vector<double> before = d_;
      std::vector<ProposedMove> longer = Joined(moves, blocks_[best]);
      d_ = With(longer);
      const std::string separates = MostChanged(before);
      for (std::size_t m = moves.size(); m < longer.size(); ++m) longer[m].separates = separates;
      moves = std::move(longer);
    }
    NextMoves next;
    if (moves.size() > 1) {
      moves.front().separates = moves[1].separates;
      next.moves = std::move(moves);
    }
    for (std::size_t p = 0; p < pairs_.size(); ++p)
      next.prospects.push_back({pairs_[p].cause, pairs_[p].rival, d_[p]});
    return next;
  }

 private:
  static std::vector<ProposedMove> Joined(std::vector<ProposedMove> moves, const MoveBlock& block) {
    moves.insert(moves.end(), block.moves.begin(), block.moves.end());
    return moves;
  }

  // D that these moves add. The moves already made do not count here: they have not separated the
  // pair.
  [[nodiscard]] std::vector<double> With(const std::vector<ProposedMove>& moves) const {
    std::vector<double> d = Apart(LookAhead(fit_, ground_, moves)->fit, groups_, pairs_);
    for (std::size_t p = 0; p < d.size(); ++p) d[p] = std::max(d[p] - made_[p], 0.0);
    return d;
  }

  [[nodiscard]] bool AllSure() const {
    return std::ranges::all_of(d_, [](double d) { return d >= kSure; });
  }

  // The blocks' worth after these moves: reduced probability of confusion per second.
  void LookAt(const std::vector<std::size_t>& which, const std::vector<ProposedMove>& moves) {
    const double confusion = ConfusionOf(d_);
    fit_.parallel(which.size(), [&](std::size_t k) {
      const MoveBlock& block = blocks_[which[k]];
      worth_[which[k]] =
          moves.size() + block.moves.size() > kNextMovesMax
              ? 0
              : (confusion - ConfusionOf(With(Joined(moves, block)))) / block.seconds;
    });
  }

  // The block that was worth most before is examined again, until the best is one just examined.
  std::size_t BestBlock(const std::vector<ProposedMove>& moves) {
    constexpr std::size_t kAtATime = 4, kRoundsMax = 6;
    std::set<std::size_t> fresh;
    for (std::size_t round = 0; round < kRoundsMax; ++round) {
      std::vector<std::size_t> order(blocks_.size());
      std::iota(order.begin(), order.end(), std::size_t{0});
      std::ranges::stable_sort(order, {}, [&](std::size_t k) { return -worth_[k]; });
      if (fresh.count(order.front()) != 0) return order.front();
      std::vector<std::size_t> again;
      for (const std::size_t k : order)
        if (again.size() < kAtATime && fresh.insert(k).second) again.push_back(k);
      LookAt(again, moves);
    }
    std::size_t best = kNoTerm;
    for (const std::size_t k : fresh)
      if (best == kNoTerm || worth_[k] > worth_[best]) best = k;
    return best;
  }

  [[nodiscard]] std::string MostChanged(const std::vector<double>& before) const {
    std::size_t most = 0;
    double change = -1;
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const double one = ConfusionAt(before[p]) - ConfusionAt(d_[p]);
      if (one > change) change = one, most = p;
    }
    return pairs_[most].cause + " | " + pairs_[most].rival;
  }

  const Fit& fit_;
  const Ground& ground_;
  const FleetGroups groups_;  // of all units, not only the examined ones
  const std::vector<Pair>& pairs_;
  std::vector<MoveBlock> blocks_;
  std::vector<double> worth_;
  std::vector<double> d_, made_;  // from the moves so far; from those already made
};

}  // namespace

double ConfusionAt(double d) {
  return 0.5 * std::erfc(std::sqrt(std::max(d, 0.0)) / 2 / std::numbers::sqrt2);
}

NextMoves ProposeMoves(const Fit& fit, const std::vector<CauseFound>& causes) {
  NextMoves none;
  std::vector<Pair> pairs;
  std::set<std::size_t> units;
  for (const CauseFound& cause : causes) {
    if (cause.candidates.size() < 2) continue;
    const std::optional<std::size_t> term = TermOf(fit, cause);
    for (std::size_t k = 1; k < cause.candidates.size(); ++k) {
      if (cause.candidates[k] == kSomethingUnknown) continue;
      if (!term || pairs.size() == kPairsMax || FindEffect(cause.candidates[k]) == nullptr)
        none.inseparable.push_back({cause.cause, cause.candidates[k]});
      else
        pairs.push_back({*term, cause.cause, cause.candidates[k], {}, 1});
    }
  }
  std::vector<TermTrace> traces;
  for (const Pair& pair : pairs) {
    const ModelTerm& term = fit.model.terms[pair.term];
    traces.push_back(TraceOf(fit, term));
    const bool in_groups = ActsOnOthers(*term.form.effect) || ActsOnOthers(*FindEffect(pair.rival));
    for (const std::size_t u : UnitsOf(fit, term, in_groups, traces.back())) units.insert(u);
  }
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const std::vector<double>& square = traces[p].square_um2;
    double chosen = 0;
    for (const std::size_t u : units) chosen += square[u];
    if (chosen > 0) pairs[p].scale = std::accumulate(square.begin(), square.end(), 0.0) / chosen;
  }
  // No unit with the term was seen: no moves of such units can separate anything.
  if (units.empty()) {
    for (const Pair& pair : pairs) none.inseparable.push_back({pair.cause, pair.rival});
    pairs.clear();
  }
  if (pairs.empty()) return none;
  Ground ground = GroundOf(fit, units);
  TakeTerms(fit, &ground, &pairs, &none);
  if (pairs.empty()) return none;
  const std::unique_ptr<FitAhead> start = LookAhead(fit, ground, {Home()});
  const FleetGroups groups = GroupsOf(*fit.facts);
  for (Pair& pair : pairs) pair.forms = NearestForms(start->fit, groups, pair.term, pair.rival);
  std::erase_if(pairs, [&](const Pair& pair) {
    if (pair.forms.empty()) none.inseparable.push_back({pair.cause, pair.rival});
    return pair.forms.empty();
  });
  if (pairs.empty()) return none;
  NextMoves next = Chooser(fit, ground, pairs).Choose();
  next.inseparable = std::move(none.inseparable);
  return next;
}

}  // namespace focalfleet::sim
