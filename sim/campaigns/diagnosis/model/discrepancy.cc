#include "sim/campaigns/diagnosis/model/discrepancy.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/distorted.h"

namespace focalfleet::sim {
namespace {

// Distortions that explain less than this, by their prior, are left out: squared whitened length.
constexpr double kWorthwhile = 0.1;

// An upper bound of the displacement that errors make in one move, um.
double Reach_um(const UnitTrack& track, const PoseErrors& errors, std::size_t move) {
  const double arm = track.unit->arm_mm[kPhi], both = track.unit->arm_mm[kTheta] + arm;
  return kUmPerMm * (kRadiansPerDegree * (both * std::abs(errors.angle_deg[kTheta][move]) +
                                          arm * std::abs(errors.angle_deg[kPhi][move])) +
                     std::abs(errors.arm_mm[kTheta][move]) + std::abs(errors.arm_mm[kPhi][move]) +
                     std::hypot(errors.x_mm[move], errors.y_mm[move]));
}

// Sums over all errors of a term.
struct Sums {
  double square[6] = {}, count = 0;
  std::size_t units = 0;
  double unit_um2 = 0;  // most of a unit
  double fleet_um2 = 0;
};

template <class Look>
void ForEachUnit(const Fit& fit, const ModelTerm& term, const Look& look) {
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    if (term.group_of_unit[unit] == kNoGroup || !fit.UsesUnit(unit)) continue;
    const UnitTrack track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
    look(unit, track, ErrorsOf(track, term, unit));
  }
}

Sums SumErrors(const Fit& fit, const ModelTerm& term) {
  Sums sums;
  ForEachUnit(fit, term, [&](std::size_t, const UnitTrack& track, const PoseErrors& errors) {
    double of_unit = 0;
    for (std::size_t i = 0; i < track.moves; ++i) {
      if (!fit.Used(track.first_row + i)) continue;
      of_unit += std::pow(Reach_um(track, errors, i), 2);
      for (std::size_t c = 0; c < errors.channels().size(); ++c)
        sums.square[c] += std::pow((*errors.channels()[c])[i], 2);
      sums.count += 1;
    }
    sums.unit_um2 = std::max(sums.unit_um2, of_unit);
    sums.fleet_um2 += of_unit;
    ++sums.units;
  });
  return sums;
}

// Means and lengths of the factors, weighted by the squared errors in units of their channel.
struct Moments {
  double weight = 0;
  std::vector<double> first, second;  // Shape: (distortions of the effect)
};

Discrepancy MakeDiscrepancy(const Fit& fit, std::size_t at) {
  const ModelTerm& term = fit.model.terms[at];
  Discrepancy made{.term = term, .of = at, .spread = term.form.effect->discrepancy};
  if (std::ranges::all_of(term.amplitude, [](double a) { return a == 0; })) return made;
  const Sums sums = SumErrors(fit, term);
  const double noise_um = std::max(fit.noise.place_um, fit.noise.least_um);
  const double prior = std::pow(made.spread / noise_um, 2);
  if (!(prior * sums.fleet_um2 > kWorthwhile)) return made;
  made.is_own = sums.units > 1 && prior * sums.unit_um2 > kWorthwhile;
  for (std::size_t c = 0; c < 6; ++c) made.size[c] = std::sqrt(sums.square[c] / sums.count);
  const std::span<const Distortion> all = term.form.effect->distortions;
  Moments moments{.first = std::vector<double>(all.size()),
                  .second = std::vector<double>(all.size())};
  ForEachUnit(fit, term, [&](std::size_t, const UnitTrack& track, const PoseErrors& errors) {
    const Conditions conditions = ConditionsOf(track);
    for (std::size_t c = 0; c < errors.channels().size(); ++c) {
      if (!(made.size[c] > 0)) continue;
      for (std::size_t i = 0; i < track.moves; ++i) {
        if (!fit.Used(track.first_row + i)) continue;
        const double relative = (*errors.channels()[c])[i] / made.size[c];
        const double weight = relative * relative;
        moments.weight += weight;
        for (std::size_t d = 0; d < all.size(); ++d) {
          const double factor =
              FactorOf(all[d], track, conditions, AxisOfChannel(term.form, c), i, relative);
          moments.first[d] += weight * factor;
          moments.second[d] += weight * factor * factor;
        }
      }
    }
  });
  if (!(moments.weight > 0)) return made;
  constexpr double kVaries = 0.05;  // rms of a factor: a smaller one is another amplitude
  for (std::size_t d = 0; d < all.size(); ++d) {
    const bool is_amplitude = all[d] == Distortion::kOwn;
    if (is_amplitude && term.sharing == Sharing::kUnit) continue;
    const double mean = is_amplitude ? 0 : moments.first[d] / moments.weight;
    const double length =
        std::sqrt(std::max(moments.second[d] / moments.weight - mean * mean, 0.0));
    if (!(length > kVaries)) continue;
    made.distortions.push_back(all[d]);
    made.mean.push_back(mean);
    made.scale.push_back(1 / length);
  }
  made.common.assign(made.distortions.size(), 0);
  made.common_sigma = made.common;
  if (made.is_own) made.own.assign(fit.model.units.size() * made.distortions.size(), 0);
  made.own_sigma = made.own;
  return made;
}

bool IsSameTerm(const ModelTerm& was, const ModelTerm& term) {
  return was.form.effect == term.form.effect && was.form.axis == term.form.axis &&
         was.form.form == term.form.form && was.form.memory == term.form.memory &&
         was.form.shape == term.form.shape && was.form.covariate == term.form.covariate &&
         was.sharing == term.sharing && was.group_of_unit == term.group_of_unit &&
         was.form.shape_of_unit == term.form.shape_of_unit &&
         was.amplitude.size() == term.amplitude.size();
}

bool AreOfTheTerms(const CampaignModel& model) {
  bool are = model.discrepancies.size() == model.terms.size();
  for (std::size_t t = 0; are && t < model.terms.size(); ++t)
    are = IsSameTerm(model.discrepancies[t].term, model.terms[t]);
  return are;
}

// Whether the term's amplitudes are those that its distortions were made for, nearly.
bool IsNearlyAs(const ModelTerm& was, const ModelTerm& term) {
  constexpr double kChange = 0.05;  // of the amplitude: the prior's spread is no better known
  double change = 0, square = 0;
  for (std::size_t k = 0; k < term.amplitude.size(); ++k) {
    change += std::pow(term.amplitude[k] - was.amplitude[k], 2);
    square += std::pow(was.amplitude[k], 2);
  }
  return change <= kChange * kChange * square;
}

}  // namespace

bool RenewDiscrepancies(Fit* fit) {
  std::vector<Discrepancy>& made = fit->model.discrepancies;
  if (!fit->has_discrepancy) return false;
  bool is_still = AreOfTheTerms(fit->model);
  for (std::size_t t = 0; is_still && t < made.size(); ++t)
    is_still = IsNearlyAs(made[t].term, fit->model.terms[t]);
  if (is_still) return false;
  std::vector<Discrepancy> anew;
  for (std::size_t t = 0; t < fit->model.terms.size(); ++t)
    anew.push_back(MakeDiscrepancy(*fit, t));
  made = std::move(anew);
  return true;
}

void DropStaleDiscrepancies(Fit* fit) {
  if (!fit->model.discrepancies.empty() && !AreOfTheTerms(fit->model))
    fit->model.discrepancies.clear();
}

void LeaveOutDiscrepancies(Fit* fit) {
  fit->has_discrepancy = false;
  fit->model.discrepancies.clear();
  UpdateResiduals(fit);
}

void DistortionColumns(const WhiteUnit& white, const Discrepancy& discrepancy,
                       Eigen::MatrixXd* columns) {
  const std::size_t count = discrepancy.distortions.size();
  columns->resize(static_cast<Eigen::Index>(2 * white.moves.size()),
                  static_cast<Eigen::Index>(count));
  PoseErrors errors;
  std::vector<double> amplitude(count, 0);
  for (std::size_t d = 0; d < count; ++d) {
    errors.Reset(white.track.moves);
    amplitude[d] = 1;
    AddDistorted(white.track, discrepancy, white.track.unit_index, amplitude, &errors);
    amplitude[d] = 0;
    WhiteDisplacement(white, errors, columns->col(static_cast<Eigen::Index>(d)).data());
  }
}

double CommonPrecision(const Discrepancy& discrepancy, std::size_t distortion) {
  constexpr double kHeld = 1e18;
  if (discrepancy.distortions[distortion] == Distortion::kOwn) return kHeld;
  return 1 / (discrepancy.spread * discrepancy.spread);
}

void UpdateSpreads(CampaignModel* model) {
  // The prior weighs as much as four amplitudes.
  constexpr double kPrior = 4;
  for (Discrepancy& of : model->discrepancies) {
    double square = kPrior * std::pow(of.term.form.effect->discrepancy, 2), count = kPrior;
    const auto add = [&](double value, double sigma) {
      if (sigma > 0) square += value * value + sigma * sigma, count += 1;
    };
    for (std::size_t d = 0; d < of.common.size(); ++d)
      if (of.distortions[d] != Distortion::kOwn) add(of.common[d], of.common_sigma[d]);
    for (std::size_t d = 0; d < of.own.size(); ++d) add(of.own[d], of.own_sigma[d]);
    of.spread = std::sqrt(square / count);
  }
}

double PriceOfDiscrepancies(const CampaignModel& model) {
  double price = 0;
  const auto add = [&](double spread, double value, double sigma) {
    if (!(sigma > 0)) return;
    price += std::log(std::max(spread * spread / (sigma * sigma), 1.0)) +
             value * value / (spread * spread);
  };
  for (const Discrepancy& of : model.discrepancies) {
    for (std::size_t d = 0; d < of.common.size(); ++d)
      if (of.distortions[d] != Distortion::kOwn) add(of.spread, of.common[d], of.common_sigma[d]);
    for (std::size_t d = 0; d < of.own.size(); ++d) add(of.spread, of.own[d], of.own_sigma[d]);
  }
  return price;
}

}  // namespace focalfleet::sim
