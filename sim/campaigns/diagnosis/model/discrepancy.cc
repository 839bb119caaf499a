#include "sim/campaigns/diagnosis/model/discrepancy.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/distorted.h"

namespace focalfleet::sim {
namespace {

// Distortions that explain less than this, by their prior, are left out: squared whitened length.
// Half and double of it change no verdict (docs/diagnosis.md, Discrepancy).
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
    look(track, UndistortedOf(track, term, unit));
  }
}

Sums SumErrors(const Fit& fit, const ModelTerm& term) {
  Sums sums;
  ForEachUnit(fit, term, [&](const UnitTrack& track, const Undistorted& of) {
    const PoseErrors& errors = of.errors;
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

// The mean of each factor over all errors, weighted by their squares in units of their channel.
std::vector<double> MeansOf(const Fit& fit, const Discrepancy& of) {
  std::vector<double> sums(of.distortions.size(), 0);
  double weights = 0;
  ForEachUnit(fit, of.term, [&](const UnitTrack& track, const Undistorted& done) {
    for (std::size_t c = 0; c < done.errors.channels().size(); ++c)
      for (std::size_t i = 0; of.size[c] > 0 && i < track.moves; ++i) {
        if (!fit.Used(track.first_row + i)) continue;
        const double weight = std::pow((*done.errors.channels()[c])[i] / of.size[c], 2);
        weights += weight;
        for (std::size_t d = 0; weight > 0 && d < sums.size(); ++d)
          sums[d] +=
              weight * FactorOf(of.distortions[d], track, done, of.term.form, c, i, of.size[c]);
      }
  });
  for (double& sum : sums) sum /= weights;
  return sums;
}

Discrepancy MakeDiscrepancy(const Fit& fit, std::size_t at) {
  const ModelTerm& term = fit.model.terms[at];
  const Effect& effect = *term.form.effect;
  Discrepancy made{.term = term, .of = at, .spread = effect.discrepancy};
  if (std::ranges::all_of(term.amplitude, [](double a) { return a == 0; })) return made;
  const Sums sums = SumErrors(fit, term);
  const double noise_um = std::max(fit.noise.place_um, fit.noise.least_um);
  const double prior = std::pow(made.spread / noise_um, 2);
  if (!(prior * sums.fleet_um2 > kWorthwhile)) return made;
  const bool is_own = sums.units > 1 && prior * sums.unit_um2 > kWorthwhile;
  for (std::size_t c = 0; c < 6; ++c) made.size[c] = std::sqrt(sums.square[c] / sums.count);
  for (const Distortion one : effect.distortions)
    if (one != Distortion::kOwn || (is_own && term.sharing != Sharing::kUnit))
      made.distortions.push_back(one);
  made.mean = MeansOf(fit, made);
  if (made.first_common() == 1) made.mean[0] = 0;
  made.common.assign(made.distortions.size() - made.first_common(), 0);
  made.common_sigma = made.common;
  if (is_own) made.own.assign(fit.model.units.size() * made.distortions.size(), 0);
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
  // A share of the amplitude: the prior's spread is no better known. Half changes no verdict,
  // double one list of candidates of 43 campaigns (docs/diagnosis.md, Discrepancy).
  constexpr double kChange = 0.05;
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
  const Undistorted of = UndistortedOf(white.track, discrepancy.term, white.track.unit_index);
  PoseErrors errors;
  for (std::size_t d = 0; d < count; ++d) {
    errors.Reset(white.track.moves);
    AddDistortion(white.track, discrepancy, of, d, 1, &errors);
    WhiteDisplacement(white, errors, columns->col(static_cast<Eigen::Index>(d)).data());
  }
}

namespace {

// Calls look(amplitude, sigma) of each amplitude that has been fitted.
template <class Look>
void ForEachAmplitude(const Discrepancy& of, const Look& look) {
  for (std::size_t d = 0; d < of.common.size(); ++d)
    if (of.common_sigma[d] > 0) look(of.common[d], of.common_sigma[d]);
  for (std::size_t d = 0; d < of.own.size(); ++d)
    if (of.own_sigma[d] > 0) look(of.own[d], of.own_sigma[d]);
}

}  // namespace

void UpdateSpreads(CampaignModel* model) {
  // The prior weighs as much as four amplitudes. Half and double change no verdict
  // (docs/diagnosis.md, Discrepancy).
  constexpr double kPrior = 4;
  for (Discrepancy& of : model->discrepancies) {
    double square = kPrior * std::pow(of.term.form.effect->discrepancy, 2), count = kPrior;
    ForEachAmplitude(of, [&](double value, double sigma) {
      square += value * value + sigma * sigma, count += 1;
    });
    of.spread = std::sqrt(square / count);
  }
}

double PriceOfDiscrepancies(const CampaignModel& model) {
  double price = 0;
  for (const Discrepancy& of : model.discrepancies)
    ForEachAmplitude(of, [&](double value, double sigma) {
      price += 2 * std::log(std::max(of.spread / sigma, 1.0)) + std::pow(value / of.spread, 2);
    });
  return price;
}

}  // namespace focalfleet::sim
