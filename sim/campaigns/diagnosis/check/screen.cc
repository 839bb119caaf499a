#include "sim/campaigns/diagnosis/check/screen.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/effects/empirical.h"

namespace focalfleet::sim {
namespace {

// Thresholds: the screen's share of the family-wise rate. A smaller share applies where the
// structure is a small part of the residuals, because named causes always leave a little by their
// shapes.
constexpr double kShareOfLittle = 0.01, kLittle = 0.1;
// Share of a look that has to be left beside the model. A cause is often nearly the true one, and
// the screen looks for the little that it leaves.
constexpr double kKeptOfScreenMin = 0.012;

// Adds the orders of the rotor behind the gear, where all units have the same gear.
void AddRotorOrders(const CampaignFacts& facts, std::size_t axis, std::vector<double>* orders) {
  const std::vector<CampaignUnit>& units = facts.campaign->units;
  const double gear = units.front().gear[axis];
  for (const CampaignUnit& unit : units)
    if (unit.gear[axis] != gear) return;
  for (const double harmonic : {1.0, 2.0, 6.0}) orders->push_back(harmonic * gear);
}

// The ripple's order between the listed ones that explains most, with its evidence.
Template WithFineOrder(const Fit& fit, const FleetGroups& groups, const Template& ripple,
                       Evidence* evidence) {
  constexpr int kEitherSide = 4;
  constexpr double kStep = 0.1;
  Templates tried;
  for (int k = -kEitherSide; k <= kEitherSide; ++k) {
    tried.push_back(ripple);
    tried.back().shape += k * kStep;
  }
  const ScorePass pass = ScoreTemplates(fit, tried);
  Template best = ripple;
  for (std::size_t k = 0; k < tried.size(); ++k) {
    Evidence one = Assess(pass.scores[k], tried[k], groups);
    if (one.log_evidence > evidence->log_evidence) *evidence = std::move(one), best = tried[k];
  }
  return best;
}

}  // namespace

Templates ScreenTemplates(const CampaignFacts& facts) {
  Templates looks;
  for (const auto& [name, column] : facts.columns) {
    if (!column.varies() || name == "sigma_um" || name == "rehomed" || name == "pixel_x" ||
        name == "pixel_y")
      continue;
    // A structure that is periodic in time may have several periods in a night.
    constexpr std::size_t kCosinesOfTime = 20;  // ten periods; half as many miss those beyond five
    const bool is_time = name == "t_s" || name == kOrder;
    const std::size_t cosines = is_time ? kCosinesOfTime : kEmpiricalCosines;
    for (int channel = 0; channel < kEmpiricalChannels; ++channel)
      for (std::size_t cosine = 1; cosine <= cosines; ++cosine)
        looks.push_back({.effect = &EmpiricalCurve(),
                         .axis = EffectAxis::kNone,
                         .form = channel,
                         .shape = static_cast<double>(cosine),
                         .label = "curve",
                         .covariate = name});
  }
  std::vector<double> orders;
  for (double order = 2; order <= 16; order += 0.5) orders.push_back(order);
  for (double order = 17; order <= 60; order += 1) orders.push_back(order);
  for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi}) {
    std::vector<double> all = orders;
    AddRotorOrders(facts, axis == EffectAxis::kTheta ? kTheta : kPhi, &all);
    for (const double order : all)
      looks.push_back({.effect = &EmpiricalRipple(),
                       .axis = axis,
                       .columns = 2,
                       .shape = order,
                       .label = "ripple",
                       .covariate = std::string(kCommand[axis == EffectAxis::kTheta ? 0 : 1])});
  }
  return looks;
}

std::optional<StructureLeft> FindStructure(const Fit& fit, double family_wise, std::uint64_t seed) {
  const Templates looks = ScreenTemplates(*fit.facts);
  if (looks.empty()) return std::nullopt;
  const FleetGroups groups = GroupsOf(*fit.facts);
  const ScorePass pass = ScoreTemplates(fit, looks);
  const double tests = EffectiveTests(pass.scores, looks, seed);
  const Best best = FindBest(pass, looks, groups, fit.parallel, tests, kShareOfSearch * family_wise,
                             kKeptOfScreenMin);
  if (best.at == kNoTerm) return std::nullopt;
  Evidence evidence = best.evidence;
  const Template look = looks[best.at].effect == &EmpiricalRipple()
                            ? WithFineOrder(fit, groups, looks[best.at], &evidence)
                            : looks[best.at];
  Fit stepped = fit;
  stepped.model.terms.push_back(MakeTerm(look, evidence, groups));
  StepFit(&stepped);
  const double size_um = SizeOf(stepped, stepped.model.terms.back());
  if (size_um < kLittle * fit.noise.typical_um &&
      best.log_p_family > std::log(kShareOfLittle * family_wise))
    return std::nullopt;
  return StructureLeft{{.covariate = look.covariate,
                        .channel = std::string(ChannelOf(look)),
                        .p_value = std::exp(best.log_p_family),
                        .size_um = size_um,
                        .delta_log_likelihood = evidence.chi_square / 2},
                       stepped.model.terms.back(),
                       tests};
}

std::optional<UnknownFound> FindOddExposures(const Fit& fit, double family_wise) {
  constexpr std::size_t kExposuresMin = 12;  // of which most have to be alike
  // Units that an exposure has at least; fewer are alike by a single outlier. With 1, 3 and 6 no
  // exposure is named in 360 campaigns without effect (4, 8, 16 units; no and 2 % of outliers).
  constexpr std::size_t kUnitsMin = 6;
  constexpr double kMedianSquare = 0.455;  // of a standard normal number
  // Motion of the image is what all units do alike in an exposure, and looks like their angles.
  if (!fit.model.exposures.empty()) return std::nullopt;
  // The angle that all units of an exposure have alike, as its normal equation.
  struct Alike {
    double g[2] = {0, 0}, b[2] = {0, 0};
    std::size_t rows = 0;
  };
  std::vector<Alike> exposures(fit.facts->exposures.size());
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      Alike& one = exposures[fit.facts->exposures.of_row[white.track.first_row + white.moves[k]]];
      ++one.rows;
      const double* w = white.filter[k].w;
      const auto at = static_cast<Eigen::Index>(2 * k);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const double* t = &white.turn_um[4 * k + 2 * axis];
        const double x = w[0] * t[0] + w[1] * t[1], y = w[1] * t[0] + w[2] * t[1];
        one.g[axis] += x * x + y * y, one.b[axis] += x * white.y[at] + y * white.y[at + 1];
      }
    }
  }
  std::optional<UnknownFound> clearest;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::vector<double> squares;
    double sum = 0;
    for (const Alike& one : exposures)
      if (one.rows >= kUnitsMin && one.g[axis] > 0)
        squares.push_back(one.b[axis] * one.b[axis] / one.g[axis]), sum += squares.back();
    if (squares.size() < kExposuresMin) continue;
    // Errors of most exposures that are alike, too, are noise that units share.
    const double spread = std::max(MiddleOf(squares) / kMedianSquare, 1.0);
    const double most = *std::ranges::max_element(squares) / spread;
    const double log_p =
        LogLeastOf(LogChiSquareTail(most, 1), 2 * static_cast<double>(squares.size()));
    if (log_p > std::log(kShareOfSearch * family_wise)) continue;
    if (clearest && clearest->p_value <= std::exp(log_p)) continue;
    const auto rows = static_cast<double>(fit.facts->campaign->rows());
    clearest = UnknownFound{.covariate = std::string(kOrder),
                            .channel = axis == kTheta ? "theta angle" : "phi angle",
                            .p_value = std::exp(log_p),
                            .size_um = fit.noise.typical_um * std::sqrt(sum / rows),
                            .delta_log_likelihood = sum / 2};
  }
  return clearest;
}

}  // namespace focalfleet::sim
