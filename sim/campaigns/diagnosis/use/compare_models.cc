#include "sim/campaigns/diagnosis/use/compare_models.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"
#include "sim/campaigns/diagnosis/terms/outliers.h"
#include "sim/campaigns/effects/empirical.h"

namespace focalfleet::sim {
namespace {

constexpr double kFarMedians = 6;  // medians of the unit's, or of the fleet's, residuals
// A unit's median: it is at another place than the model has it.
constexpr double kElsewhereUm = 1e3;
constexpr double kSameUm = 1e-3;  // smaller differences are the digits of a file
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Lengths of one model's residuals; NaN where nothing was measured or the row is set aside.
std::vector<double> LengthsOf(const CampaignModel& model, const CampaignFacts& facts,
                              const std::vector<char>& aside, const ParallelFor& parallel) {
  const Campaign& campaign = *facts.campaign;
  const Places places = Predict(model, facts, parallel);
  Places measured{campaign.x_mm, campaign.y_mm};
  TakeToOne(facts.frames, FitFrames(facts.frames, places, measured), {}, &measured);
  std::vector<double> lengths(campaign.rows(), kNone);
  for (std::size_t row = 0; row < lengths.size(); ++row)
    if (aside[row] == 0)
      lengths[row] = 1e3 * std::hypot(measured.x_mm[row] - places.x_mm[row],
                                      measured.y_mm[row] - places.y_mm[row]);
  return lengths;
}

double MedianOf(std::span<const double> lengths) {
  std::vector<double> known;
  for (const double length : lengths)
    if (std::isfinite(length)) known.push_back(length);
  return known.empty() ? 0 : Median(std::move(known));
}

// Units that are elsewhere by one model's residuals, and rows far from where the rest of their unit
// is. A unit that is off in all of its rows has no outliers.
struct FarOff {
  std::vector<char> unit;  // Shape: (units)
  std::vector<char> row;   // Shape: (rows)
};

FarOff FindFarOff(const Campaign& campaign, const std::vector<double>& lengths) {
  FarOff far{std::vector<char>(campaign.units.size(), 0), std::vector<char>(lengths.size(), 0)};
  const double fleet_um = MedianOf(lengths);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t begin = campaign.first_row[unit], end = campaign.first_row[unit + 1];
    const double own_um = MedianOf(std::span(lengths).subspan(begin, end - begin));
    far.unit[unit] = own_um > kElsewhereUm ? 1 : 0;
    for (std::size_t row = begin; row < end; ++row)
      far.row[row] = lengths[row] > kFarMedians * std::max(fleet_um, own_um) ? 1 : 0;
  }
  return far;
}

// Squares of one exposure's residuals.
struct ExposureSum {
  double a = 0, b = 0, n = 0;
};

double DifferenceOfRms(const ExposureSum& sum) {
  return sum.n > 0 ? std::sqrt(sum.b / sum.n) - std::sqrt(sum.a / sum.n) : 0;
}

void TakeInterval(const std::vector<ExposureSum>& exposures, const CompareOptions& options,
                  ModelComparison* out) {
  Rng rng = Rng::Stream(options.seed, "compare models");
  std::vector<double> drawn;
  for (std::size_t k = 0; k < options.resamples; ++k) {
    ExposureSum sum;
    for (std::size_t e = 0; e < exposures.size(); ++e) {
      const ExposureSum& one = exposures[rng.Below(exposures.size())];
      sum.a += one.a, sum.b += one.b, sum.n += one.n;
    }
    drawn.push_back(DifferenceOfRms(sum));
  }
  out->ci95_um[0] = Quantile(drawn, 0.025), out->ci95_um[1] = Quantile(drawn, 0.975);
  if (exposures.size() < kExposuresForPreference || std::abs(out->difference_um) < kSameUm) return;
  if (out->ci95_um[0] > 0) out->preference = Preference::kA;
  if (out->ci95_um[1] < 0) out->preference = Preference::kB;
}

std::size_t UnitsOf(const ModelTerm& term) {
  return term.group_of_unit.size() -
         static_cast<std::size_t>(
             std::count(term.group_of_unit.begin(), term.group_of_unit.end(), kNoGroup));
}

bool IsSameKind(const Template& a, const Template& b) {
  return a.effect->cause == b.effect->cause && a.axis == b.axis && a.covariate == b.covariate &&
         (FindEmpirical(a.effect->cause) == nullptr || a.form == b.form);
}

// Whether the amplitudes of both templates mean the same.
bool IsSameShape(const Template& a, const Template& b) {
  return a.form == b.form && a.memory == b.memory && a.columns == b.columns &&
         (a.effect->continuous_shape || (a.shape == b.shape && a.shape_of_unit == b.shape_of_unit));
}

// The normal deviate that is as unlikely as the chi-square.
double DeviateOf(double chi_square, double dof) {
  const double wanted = LogChiSquareTail(chi_square, dof);
  double low = 0, high = std::sqrt(chi_square);  // the deviate with one degree of freedom
  constexpr int kHalvings = 60;
  for (int k = 0; k < kHalvings && dof > 1; ++k) {
    const double middle = 0.5 * (low + high);
    (LogChiSquareTail(middle * middle, 1) > wanted ? low : high) = middle;
  }
  return high;
}

double SigmasBetween(const ModelTerm& a, const ModelTerm& b) {
  if (!IsSameShape(a.form, b.form)) return kNone;
  const std::size_t columns = a.form.columns;
  std::set<std::pair<std::uint32_t, std::uint32_t>> groups;
  for (std::size_t unit = 0; unit < a.group_of_unit.size(); ++unit)
    if (a.group_of_unit[unit] != kNoGroup && b.group_of_unit[unit] != kNoGroup)
      groups.emplace(a.group_of_unit[unit], b.group_of_unit[unit]);
  double chi_square = 0, dof = 0;
  for (const auto& [at_a, at_b] : groups)
    for (std::size_t c = 0; c < columns; ++c) {
      const std::size_t i = at_a * columns + c, j = at_b * columns + c;
      const double variance = a.sigma[i] * a.sigma[i] + b.sigma[j] * b.sigma[j];
      if (!(variance > 0)) return kNone;
      chi_square += std::pow(b.amplitude[j] - a.amplitude[i], 2) / variance;
      dof += 1;
    }
  return dof > 0 ? DeviateOf(chi_square, dof) : kNone;
}

TermDifference DescribeTerm(const Template& form) {
  TermDifference out;
  out.cause = form.effect->cause;
  const bool empirical = FindEmpirical(form.effect->cause) != nullptr;
  out.axis = empirical ? ChannelOf(form) : Name(form.axis);
  out.amplitude_unit = form.effect->amplitude_unit;
  out.sigmas = kNone;
  return out;
}

TermSide SideOf(const ModelTerm& term) {
  return {.shape = term.form.label, .units = UnitsOf(term), .amplitude = Summarise(term)};
}

// B's counterpart of A's term, not yet taken by another term; one of the same shape first.
std::size_t CounterpartOf(const ModelTerm& term, const std::vector<ModelTerm>& others,
                          const std::vector<char>& taken) {
  std::size_t at = others.size();
  for (std::size_t k = others.size(); k-- > 0;) {
    if (taken[k] != 0 || !IsSameKind(term.form, others[k].form)) continue;
    if (at == others.size() || IsSameShape(term.form, others[k].form) ||
        !IsSameShape(term.form, others[at].form))
      at = k;
  }
  return at;
}

std::vector<TermDifference> TermDifferences(const ModelPair& models) {
  std::vector<TermDifference> out;
  std::vector<char> taken(models.b->terms.size(), 0);
  for (const ModelTerm& term : models.a->terms) {
    out.push_back(DescribeTerm(term.form));
    out.back().a = SideOf(term);
    const std::size_t at = CounterpartOf(term, models.b->terms, taken);
    if (at == models.b->terms.size()) continue;
    taken[at] = 1;
    out.back().b = SideOf(models.b->terms[at]);
    out.back().sigmas = SigmasBetween(term, models.b->terms[at]);
  }
  for (std::size_t k = 0; k < models.b->terms.size(); ++k) {
    if (taken[k] != 0) continue;
    out.push_back(DescribeTerm(models.b->terms[k].form));
    out.back().b = SideOf(models.b->terms[k]);
  }
  return out;
}

}  // namespace

ModelComparison CompareModels(const ModelPair& models, const Campaign& given,
                              const CompareOptions& options) {
  ModelComparison out;
  Campaign campaign = given;
  const RepeatedPlaces repeated = ForgetRepeatedPlaces(&campaign);
  campaign.units = FindCoordinatorsGeometry(campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  std::vector<char> aside;
  out.left_out = FindBeforeFit(facts, repeated, &aside).why;
  CampaignModel a = *models.a, b = *models.b;
  out.a.left_out = LeaveOutUntestable(facts, &a), out.b.left_out = LeaveOutUntestable(facts, &b);
  const std::vector<double> lengths_a = LengthsOf(a, facts, aside, options.parallel);
  const std::vector<double> lengths_b = LengthsOf(b, facts, aside, options.parallel);
  const FarOff far_a = FindFarOff(campaign, lengths_a), far_b = FindFarOff(campaign, lengths_b);
  std::vector<ExposureSum> sums(facts.exposures.size());
  std::vector<double> judged_a, judged_b;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const bool elsewhere = far_a.unit[unit] != 0 && far_b.unit[unit] != 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (!std::isfinite(lengths_a[row]) || !std::isfinite(lengths_b[row])) continue;
      if (elsewhere || (far_a.row[row] != 0 && far_b.row[row] != 0)) {
        ++out.left_out[elsewhere ? "unit stands elsewhere by both models"
                                 : "far off by both models"];
        continue;
      }
      judged_a.push_back(lengths_a[row]), judged_b.push_back(lengths_b[row]);
      ExposureSum& sum = sums[facts.exposures.of_row[row]];
      sum.a += lengths_a[row] * lengths_a[row], sum.b += lengths_b[row] * lengths_b[row];
      sum.n += 1;
    }
  }
  std::erase_if(sums, [](const ExposureSum& sum) { return sum.n == 0; });
  out.rows = judged_a.size(), out.exposures = sums.size();
  if (out.rows == 0) return out;
  ExposureSum all;
  for (const ExposureSum& sum : sums) all.a += sum.a, all.b += sum.b, all.n += sum.n;
  out.a.rms_um = std::sqrt(all.a / all.n), out.b.rms_um = std::sqrt(all.b / all.n);
  out.a.mad_um = Median(std::move(judged_a)), out.b.mad_um = Median(std::move(judged_b));
  out.difference_um = DifferenceOfRms(all);
  TakeInterval(sums, options, &out);
  return out;
}

ModelDifference DifferenceOf(const ModelPair& models) {
  struct Look {
    const char* what;
    const char* unit;
    double (*of)(const CampaignUnit& a, const CampaignUnit& b);
  };
  constexpr Look kLooks[] = {
      {"theta zero", "deg",
       [](const CampaignUnit& a, const CampaignUnit& b) {
         return std::remainder(b.zero_deg[kTheta] - a.zero_deg[kTheta], 360.0);
       }},
      {"phi zero", "deg",
       [](const CampaignUnit& a, const CampaignUnit& b) {
         return std::remainder(b.zero_deg[kPhi] - a.zero_deg[kPhi], 360.0);
       }},
      {"base", "um",
       [](const CampaignUnit& a, const CampaignUnit& b) {
         return 1e3 * std::hypot(b.base_x_mm - a.base_x_mm, b.base_y_mm - a.base_y_mm);
       }},
      {"theta arm", "um",
       [](const CampaignUnit& a, const CampaignUnit& b) {
         return 1e3 * (b.arm_mm[kTheta] - a.arm_mm[kTheta]);
       }},
      {"phi arm", "um", [](const CampaignUnit& a, const CampaignUnit& b) {
         return 1e3 * (b.arm_mm[kPhi] - a.arm_mm[kPhi]);
       }}};
  ModelDifference out{.terms = TermDifferences(models), .geometry = {}};
  const std::size_t units = models.a->units.size();
  for (const Look& look : kLooks) {
    GeometryDifference found{.what = look.what, .unit = look.unit};
    double square = 0;
    for (std::size_t unit = 0; unit < units; ++unit) {
      const double change = look.of(models.a->units[unit], models.b->units[unit]);
      square += change * change;
      if (std::abs(change) <= std::abs(found.largest) && unit > 0) continue;
      found.largest = change, found.largest_unit = models.a->units[unit].id;
    }
    found.rms = std::sqrt(square / static_cast<double>(std::max<std::size_t>(units, 1)));
    out.geometry.push_back(found);
  }
  return out;
}

}  // namespace focalfleet::sim
