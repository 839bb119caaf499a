#include "sim/campaigns/diagnosis/score/evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/neighbour_sum.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
constexpr int kMost = static_cast<int>(kColumnsMax);
// A vector of one group, without heap memory, as there may be thousands of groups for each
// template.
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;

constexpr double kSizes[] = {0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000};  // of the prior
// Shares of units that have the effect: where nearly all do, one that shows little has it, too.
constexpr double kShares[] = {1, 0.98, 0.9, 0.7, 0.4, 0.2, 0.05, 0.01, 0.002};
constexpr double kOddsMax = 1e90;  // beyond it one of two summands is lost in the other's rounding
constexpr double kFlat = 1e-9;  // of the largest curvature: a direction that the data do not show

// A group's score along its principal directions.
struct Direction2 {
  double b2 = 0;  // squared
  double g = 0;
};
struct GroupScore {
  double chi_square = 0;
  [[nodiscard]] std::span<const Direction2> along() const {
    return std::span(along_).first(count_);
  }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  void Add(const Direction2& direction) { along_[count_++] = direction; }
  /// Lowers the evidence by the price of a choice.
  void Charge(double price) {
    if (empty()) return;
    price_ += price;
    chi_square = std::max(chi_square - 2 * price, 0.0);
  }
  [[nodiscard]] double LogEvidence(double size) const {
    double sum = -price_;
    const double a2 = size * size;
    for (const Direction2& d : along())
      sum += 0.5 * d.b2 * a2 / (1 + a2 * d.g) - 0.5 * std::log1p(a2 * d.g);
    return sum;
  }

 private:
  std::array<Direction2, kColumnsMax> along_;
  std::size_t count_ = 0;
  double price_ = 0;
};

GroupScore Decompose(const Vector& b, const Square& g, double dispersion) {
  GroupScore out;
  if (b.size() == 1) {
    if (!(g(0, 0) > 0)) return out;
    out.Add({b[0] * b[0] / (dispersion * dispersion), g(0, 0) / dispersion});
  } else {
    const Eigen::SelfAdjointEigenSolver<Square> solver(g);
    const double most = solver.eigenvalues().maxCoeff();
    for (Index k = 0; k < b.size(); ++k) {
      const double value = solver.eigenvalues()[k];
      if (!(value > kFlat * most) || !(most > 0)) continue;
      const double along = solver.eigenvectors().col(k).dot(b);
      out.Add({along * along / (dispersion * dispersion), value / dispersion});
    }
  }
  for (const Direction2& d : out.along()) out.chi_square += d.b2 / d.g;
  return out;
}

// An amplitude that is impossible is no evidence for the effect.
GroupScore DecomposePossible(const Template& form, const Vector& b, const Square& g,
                             double dispersion) {
  if (IsImpossible(form, b, g)) return Decompose(Vector::Zero(b.size()), g, dispersion);
  return Decompose(b, g, dispersion);
}

Vector UnitB(const std::vector<double>& values, std::size_t unit, std::size_t c) {
  return Eigen::Map<const Vector>(values.data() + unit * c, static_cast<Index>(c));
}
Square UnitG(const Score& score, std::size_t unit, std::size_t c) {
  return Eigen::Map<const Square>(score.g.data() + unit * c * c, static_cast<Index>(c),
                                  static_cast<Index>(c));
}

// Sums over the units of each group.
struct GroupSums {
  std::vector<Vector> b;
  std::vector<Square> g;
};
GroupSums SumGroups(const std::vector<double>& unit_b, const Score& score, std::size_t c,
                    const std::vector<std::uint32_t>& group_of_unit, std::size_t groups) {
  const auto ic = static_cast<Index>(c);
  GroupSums sums{std::vector<Vector>(groups, Vector::Zero(ic)),
                 std::vector<Square>(groups, Square::Zero(ic, ic))};
  for (std::size_t unit = 0; unit < group_of_unit.size(); ++unit) {
    if (group_of_unit[unit] == kNoGroup) continue;
    sums.b[group_of_unit[unit]] += UnitB(unit_b, unit, c);
    sums.g[group_of_unit[unit]] += UnitG(score, unit, c);
  }
  return sums;
}

// A level: groups with an amplitude each.
struct Level {
  Sharing sharing = Sharing::kUnit;
  std::vector<GroupScore> groups;
  std::vector<std::uint32_t> group_of_unit;
  // Groups that have the effect together or not at all, as a rail's units. Empty: each by itself.
  std::vector<std::uint32_t> together;
  [[nodiscard]] std::size_t as_one(std::size_t group) const {
    return together.empty() ? group : together[group];
  }
};

std::vector<std::uint32_t> Each(std::size_t units) {
  std::vector<std::uint32_t> each(units);
  std::iota(each.begin(), each.end(), 0u);
  return each;
}

// The level at which each unit has its own amplitude.
Level UnitLevel(const Score& score, const Template& form, double dispersion) {
  const std::size_t c = form.columns, units = score.b.size() / c;
  Level level{Sharing::kUnit, {}, Each(units)};
  level.groups.reserve(units);
  for (std::size_t unit = 0; unit < units; ++unit) {
    level.groups.push_back(
        DecomposePossible(form, UnitB(score.b, unit, c), UnitG(score, unit, c), dispersion));
    level.groups.back().Charge(form.shape_of_unit.empty() ? 0 : std::log(form.choices));
  }
  return level;
}

Level SumLevel(const Score& score, const Template& form, Sharing sharing,
               const std::vector<std::uint32_t>& group_of_unit, std::size_t groups,
               double dispersion) {
  const GroupSums sums = SumGroups(score.b, score, form.columns, group_of_unit, groups);
  Level level{sharing, {}, group_of_unit};
  for (std::size_t k = 0; k < groups; ++k)
    level.groups.push_back(DecomposePossible(form, sums.b[k], sums.g[k], dispersion));
  return level;
}

// ln p of the level: its best group among all, or all together.
double LevelLogP(const Level& level, const NoiseLevel& noise) {
  double sum = 0, dof = 0;
  double tests = 0;
  std::array<double, kColumnsMax + 1> most{};  // chi-square of the best group, by its freedom
  // The noise of a single unit is known from its own rows only.
  constexpr double kOwnNoise = 1.15;
  const double inflation =
      level.sharing == Sharing::kUnit && level.groups.size() > 1 ? kOwnNoise : 1;
  for (const GroupScore& group : level.groups) {
    if (group.empty()) continue;
    sum += group.chi_square;
    dof += static_cast<double>(group.along().size());
    tests += 1;
    most[group.along().size()] = std::max(most[group.along().size()], group.chi_square);
  }
  if (tests == 0) return 0;
  double best = 0;
  for (std::size_t freedom = 1; freedom < most.size(); ++freedom)
    if (most[freedom] > 0)
      best =
          std::min(best, LogChiSquareTail(most[freedom] / inflation, static_cast<double>(freedom)));
  // A sum over units varies by more than chance where the noise differs from template to template:
  // a chi-square of that variance (Satterthwaite, Biometrics Bulletin 2, 110, 1946).
  const double all = LogChiSquareTail(sum / (noise.mean * noise.excess), dof / noise.excess);
  return tests == 1 ? all : std::min(all, LogLeastOf(best, tests)) + std::log(2.0);
}

struct MixtureFit {
  double log_evidence = -std::numeric_limits<double>::infinity();
  double size = 0, share = 1;
};

// ln of the product of 1 - share + share exp(e) over the groups: each has the effect or not.
// `odds`: exp(e), as far as that is a number.
double LogMixture(const std::vector<double>& evidence, const std::vector<double>& odds,
                  double share) {
  constexpr double kLarge = 1e200;
  double sum = 0, product = 1;
  for (std::size_t k = 0; k < evidence.size(); ++k) {
    if (odds[k] > kOddsMax) {
      sum += std::log(share) + evidence[k];  // the other summand is negligible
      continue;
    }
    product *= 1 - share + share * odds[k];
    // A single logarithm serves many factors.
    if (product > kLarge || product < 1 / kLarge) sum += std::log(product), product = 1;
  }
  return sum + std::log(product);
}

// Evidence summed over the groups that have the effect together; NaN where no group has data.
// Shape: (groups), by `Level::as_one`.
void SumTogether(const Level& level, double size, std::vector<double>* evidence) {
  evidence->assign(level.groups.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < level.groups.size(); ++k) {
    if (level.groups[k].empty()) continue;
    double& sum = (*evidence)[level.as_one(k)];
    sum = (std::isnan(sum) ? 0 : sum) + level.groups[k].LogEvidence(size);
  }
}

// Average over sizes and shares; the best of them decides which groups have the effect.
MixtureFit Mix(const Level& level, double prior_size) {
  MixtureFit best;
  double most = -std::numeric_limits<double>::infinity();
  std::vector<double> terms, evidence, odds;
  for (const double relative : kSizes) {
    const double size = prior_size * relative;
    SumTogether(level, size, &evidence);
    std::erase_if(evidence, [](double one) { return std::isnan(one); });
    odds.clear();
    for (const double one : evidence) odds.push_back(std::exp(one));
    for (const double share : kShares) {
      if (evidence.size() < 2 && share < 1) break;
      const double sum = share >= 1 ? std::accumulate(evidence.begin(), evidence.end(), 0.0)
                                    : LogMixture(evidence, odds, share);
      terms.push_back(sum);
      if (sum > most) most = sum, best.size = size, best.share = share;
    }
  }
  best.log_evidence = LogSum(terms) - std::log(static_cast<double>(terms.size()));
  return best;
}

// Units' own amplitudes about a mean: evidence, and the spread that fits best. Pre: one column.
// `price`: of each unit.
struct ScatterFit {
  double log_evidence = -std::numeric_limits<double>::infinity();
  double spread = 0;
};
ScatterFit Scatter(const Score& score, double prior_size, double dispersion, double price) {
  ScatterFit best;
  std::vector<double> terms;
  double most = -std::numeric_limits<double>::infinity();
  const std::size_t units = score.b.size();
  for (const double relative : {0.01, 0.03, 0.1, 0.3, 1.0, 3.0}) {
    const double spread = relative * prior_size, s2 = spread * spread;
    double weight = 0, mean = 0, sum = 0;
    for (std::size_t u = 0; u < units; ++u) {
      const double g = score.g[u] / dispersion;
      if (!(g > 0)) continue;
      const double w = g / (1 + s2 * g);
      weight += w;
      mean += w * score.b[u] / score.g[u];
    }
    if (!(weight > 0)) return best;
    mean /= weight;
    for (std::size_t u = 0; u < units; ++u) {
      const double g = score.g[u] / dispersion;
      if (!(g > 0)) continue;
      const double own = score.b[u] / score.g[u];
      sum += -0.5 * std::log1p(s2 * g) + 0.5 * own * own * g -
             0.5 * (own - mean) * (own - mean) * g / (1 + s2 * g) - price;
    }
    // The mean is free: it pays for its own size.
    const double size = std::max(std::abs(mean), prior_size);
    sum -= 0.5 * std::log1p(size * size * weight);
    terms.push_back(sum);
    if (sum > most) most = sum, best.spread = spread;
  }
  best.log_evidence = LogSum(terms) - std::log(static_cast<double>(terms.size()));
  return best;
}

// A unit whose geometry hides the effect tells nothing of it. The unit has it where most others do:
// otherwise its geometry takes up what the effect does, and differs from the table for no reason.
void TakeMixture(const Level& level, const Template& form, const MixtureFit& fit, Evidence* out) {
  out->sharing = level.sharing;
  out->log_evidence = fit.log_evidence;
  out->spread = fit.size;
  out->scattered = false;
  out->chi_square = 0;
  out->has.assign(level.group_of_unit.size(), 0);
  std::vector<char> group_has(level.groups.size(), 0);
  std::vector<double> evidence;
  SumTogether(level, fit.size, &evidence);
  for (std::size_t k = 0; k < level.groups.size(); ++k) {
    const bool is_hidden = level.groups[k].empty();
    // Without a shape of its own such a unit cannot have the effect.
    if (is_hidden && (level.sharing != Sharing::kUnit || !form.shape_of_unit.empty())) continue;
    const double odds = fit.share >= 1 ? 1
                                       : std::log(fit.share) - std::log1p(-fit.share) +
                                             (is_hidden ? 0 : evidence[level.as_one(k)]);
    group_has[k] = odds > 0 ? 1 : 0;
    if (group_has[k] != 0) out->chi_square += level.groups[k].chi_square;
  }
  for (std::size_t u = 0; u < level.group_of_unit.size(); ++u)
    if (level.group_of_unit[u] != kNoGroup) out->has[u] = group_has[level.group_of_unit[u]];
}

double UnitDispersion(const Score& score) {
  // The estimate of a single unit is noisy: it gets some prior weight at 1.
  constexpr double kPrior = 4;
  return (score.spread_sum + kPrior) / (score.spread_count + kPrior);
}

}  // namespace

double FleetDispersion(const Score& score, std::size_t columns) {
  const auto c = static_cast<Index>(columns);
  Vector b = Vector::Zero(c);
  Square g = Square::Zero(c, c);
  const std::size_t exposures = score.exposure_b.size() / columns;
  const auto at_b = [&](std::size_t e) {
    return Eigen::Map<const Vector>(score.exposure_b.data() + e * columns, c);
  };
  const auto at_g = [&](std::size_t e) {
    return Eigen::Map<const Square>(score.exposure_g.data() + e * columns * columns, c, c);
  };
  for (std::size_t e = 0; e < exposures; ++e) b += at_b(e), g += at_g(e);
  if (!(g.trace() > 0)) return 1;
  const Eigen::CompleteOrthogonalDecomposition<Square> solver(g);
  const Vector own = solver.solve(b);
  // A generalised inverse: columns may be alike in all units.
  NeighbourSum<Eigen::Dynamic> sum(solver.pseudoInverse());
  double fourth = 0;
  for (std::size_t e = 0; e < exposures; ++e) {
    sum.Add(at_b(e) - at_g(e) * own);
    fourth += at_g(e).trace() * at_g(e).trace();
  }
  // Few exposures carry the score, so that their own dispersion is uncertain.
  const double effective = g.trace() * g.trace() / std::max(fourth, 1e-300);
  constexpr double kPrior = 6;
  const double raw = sum.sum() / static_cast<double>(c) * effective / std::max(effective - 1, 1.0);
  return (effective * raw + kPrior) / (effective + kPrior);
}

Evidence Assess(const Score& score, const Template& form, const FleetGroups& groups,
                const NoiseLevel& noise) {
  const std::size_t c = form.columns;
  const std::size_t units = score.b.size() / c;
  const double prior = form.effect->prior_size;
  Evidence best;
  best.dispersion = std::max(1.0, UnitDispersion(score));
  std::vector<Level> levels;
  const bool of_the_whole = IsOfTheWhole(form);
  if (units == 1 || !of_the_whole) {
    levels.push_back(UnitLevel(score, form, best.dispersion));
    levels.back().together = Together(form.effect->owner, groups, units);
  }
  if (units > 1 && form.shape_of_unit.empty()) {
    // Noise that units share may look like an effect that they share. The levels themselves are
    // compared with one dispersion.
    const double fleet = std::max(best.dispersion, FleetDispersion(score, c));
    const Level cautious{Sharing::kFleet,
                         {DecomposePossible(form, score.fleet_b, score.fleet_g, fleet)},
                         std::vector<std::uint32_t>(units, 0)};
    best.log_p = LevelLogP(cautious, {});
    const auto look = [&](Sharing sharing, const std::vector<std::uint32_t>& of,
                          std::size_t count) {
      best.log_p =
          std::min(best.log_p, LevelLogP(SumLevel(score, form, sharing, of, count, fleet), {}));
      levels.push_back(SumLevel(score, form, sharing, of, count, best.dispersion));
    };
    Level all{Sharing::kFleet,
              {DecomposePossible(form, score.fleet_b, score.fleet_g, best.dispersion)},
              std::vector<std::uint32_t>(units, 0)};
    const Owner owner = form.effect->owner;
    if (groups.rails > 0 && !of_the_whole && owner != Owner::kBus)
      look(Sharing::kRail, groups.rail, groups.rails);
    if (groups.buses > 0 && !of_the_whole && owner != Owner::kRail)
      look(Sharing::kBus, groups.bus, groups.buses);
    levels.push_back(std::move(all));
  }
  // The levels are compared by noise that is as large as it was fitted, or larger. Chance is by
  // what it is found to be.
  const NoiseLevel of_units{std::max(noise.mean, UnitDispersion(score)) / best.dispersion,
                            noise.excess};
  best.log_evidence = -std::numeric_limits<double>::infinity();
  for (const Level& level : levels)
    if (level.sharing == Sharing::kUnit)
      best.log_p = std::min(best.log_p, LevelLogP(level, of_units));
  best.log_p = std::min(0.0, best.log_p + std::log(static_cast<double>(levels.size())));
  // Units' own shapes have been paid for by each unit.
  const double price = form.shape_of_unit.empty() ? std::log(form.choices) : 0;
  best.log_p = std::min(0.0, best.log_p + price);
  // Chance explains less evidence: which units have the effect is not computed.
  constexpr double kWorthALook = -3;
  if (best.log_p > kWorthALook) {
    best.log_evidence = 0;
    best.has.assign(units, 0);
    return best;
  }
  for (const Level& level : levels) {
    const MixtureFit fit = Mix(level, prior);
    if (fit.log_evidence > best.log_evidence) TakeMixture(level, form, fit, &best);
  }
  if (units > 2 && c == 1 && !of_the_whole) {
    const ScatterFit scatter = Scatter(score, prior, best.dispersion,
                                       form.shape_of_unit.empty() ? 0 : std::log(form.choices));
    // A scatter that pays for itself is taken only as a refinement of an effect that all share.
    if (scatter.log_evidence > best.log_evidence + 3) {
      best.sharing = Sharing::kUnit;
      best.log_evidence = scatter.log_evidence;
      best.spread = scatter.spread;
      best.scattered = true;
      best.chi_square = 0;
      for (std::size_t unit = 0; unit < units; ++unit) {
        const GroupScore& own = levels.front().groups[unit];
        best.chi_square += own.chi_square;
        // A unit without a shape, where each may have its own, does not have the effect.
        best.has[unit] = form.shape_of_unit.empty() || !own.empty() ? 1 : 0;
      }
    }
  }
  best.log_evidence -= price;
  return best;
}

double ShareOfTarget(const Score& score, const Template& form, const Evidence& as,
                     const FleetGroups& groups, double target_square) {
  if (!(target_square > 0)) return 0;
  const std::size_t c = form.columns;
  const std::size_t units = score.b.size() / c;
  double taken = 0;
  if (as.sharing == Sharing::kFleet) {
    taken = Decompose(score.fleet_target_b, score.fleet_g, 1).chi_square;
  } else if (as.sharing == Sharing::kUnit) {
    for (std::size_t unit = 0; unit < units; ++unit)
      taken += Decompose(UnitB(score.target_b, unit, c), UnitG(score, unit, c), 1).chi_square;
  } else {
    const bool by_rail = as.sharing == Sharing::kRail;
    const std::vector<std::uint32_t>& group_of = by_rail ? groups.rail : groups.bus;
    const std::size_t count = by_rail ? groups.rails : groups.buses;
    const GroupSums sums = SumGroups(score.target_b, score, c, group_of, count);
    for (std::size_t k = 0; k < count; ++k) taken += Decompose(sums.b[k], sums.g[k], 1).chi_square;
  }
  return std::clamp(taken / target_square, 0.0, 1.0);
}

double EffectiveTests(const std::vector<Score>& scores, const Templates& templates,
                      std::uint64_t seed) {
  constexpr std::size_t kFlips = 200;
  constexpr std::size_t kExposuresMin = 12;
  constexpr double kShare = 0.1;
  const auto all = static_cast<double>(templates.size());
  if (scores.empty()) return 1;
  const std::size_t exposures = scores[0].exposure_b.size() / templates[0].columns;
  if (exposures < kExposuresMin) return std::max(all, 1.0);
  // First columns only; further columns of a template go the same way.
  std::vector<double> scale(scores.size());
  for (std::size_t k = 0; k < scores.size(); ++k) {
    const std::size_t c = templates[k].columns;
    double square = 0;
    for (std::size_t e = 0; e < exposures; ++e) {
      const double b = scores[k].exposure_b[e * c];
      square += b * b;
    }
    scale[k] = square > 0 ? 1 / square : 0;
  }
  Rng rng = Rng::Stream(seed, "flips");
  std::vector<double> least(kFlips);
  std::vector<double> sign(exposures);
  for (double& p : least) {
    for (double& s : sign) s = rng.Uniform() < 0.5 ? -1 : 1;
    double most = 0;
    for (std::size_t k = 0; k < scores.size(); ++k) {
      const std::size_t c = templates[k].columns;
      double sum = 0;
      for (std::size_t e = 0; e < exposures; ++e) sum += sign[e] * scores[k].exposure_b[e * c];
      most = std::max(most, sum * sum * scale[k]);
    }
    p = LogChiSquareTail(most, 1);
  }
  const double low = std::exp(Quantile(least, kShare));
  return std::clamp(-std::log1p(-kShare) / std::max(low, 1e-12), 1.0, std::max(all, 1.0));
}

}  // namespace focalfleet::sim
