#include "sim/campaigns/diagnosis/search/quick_look.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <set>
#include <unsupported/Eigen/FFT>

#include "sim/campaigns/diagnosis/model/angle_errors.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// The angle of one unit, with its median removed and outliers limited.
struct Series {
  UnitTrack track;
  std::vector<AngleRow> rows;
  std::vector<double> weight;  // by the lever
  double square = 0;           // weighted sum over the rows
};

constexpr std::size_t kRowsMin = 12;

Series SeriesOf(const Fit& fit, std::size_t unit, std::size_t axis) {
  constexpr double kFar = 4, kOfNormal = 0.6745;
  Series series{TrackOf(fit.model, *fit.facts, unit), {}, {}};
  series.rows = AngleErrors(fit, series.track, axis);
  if (series.rows.size() < kRowsMin) return series;
  std::vector<double> errors;
  for (const AngleRow& row : series.rows) errors.push_back(row.error_deg);
  const double middle = Median(errors);
  for (double& error : errors) error = std::abs(error - middle);
  const double far = kFar * Median(std::move(errors)) / kOfNormal;
  for (AngleRow& row : series.rows) {
    const double far_deg = std::max(far, kFar * row.sigma_deg(1e-3 * fit.noise.least_um));
    row.error_deg = std::clamp(row.error_deg - middle, -far_deg, far_deg);
    series.weight.push_back(row.lever_mm * row.lever_mm);
    series.square += series.weight.back() * row.error_deg * row.error_deg;
  }
  return series;
}

// Sums of the template's signature s against the errors r, without its mean.
struct Products {
  double rs = 0, ss = 0;
};
Products ProductsOf(const Series& series, const Template& form, std::size_t axis,
                    PoseErrors* errors) {
  ApplyColumn(series.track, form, 0, 1, errors);
  const std::vector<double>& s = errors->angle_deg[axis];
  double weight = 0, mean = 0, error = 0;
  Products sum;
  for (std::size_t k = 0; k < series.rows.size(); ++k) {
    const double w = series.weight[k], at = s[series.rows[k].move];
    weight += w, mean += w * at, error += w * series.rows[k].error_deg;
    sum.rs += w * series.rows[k].error_deg * at;
    sum.ss += w * at * at;
  }
  sum.rs -= mean * error / weight;
  sum.ss -= mean * mean / weight;
  return sum;
}

bool CanBeOf(const Template& form, const Products& sum) {
  return sum.ss > 0 && CanBe(form, sum.rs / sum.ss, 0);
}

// Results for an axis: the best unit's gain in 2 ln L by each template, and sums over the fleet.
struct Glances {
  std::vector<double> most;
  std::vector<Products> fleet;
};

Glances GlanceAt(const Fit& fit, const Templates& forms, std::size_t axis) {
  const std::vector<UnitChunk> chunks = ChunksOf(fit.model.units.size());
  std::vector<Glances> of_chunk(chunks.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    Glances& own = of_chunk[chunk];
    own = {std::vector<double>(forms.size(), 0), std::vector<Products>(forms.size())};
    PoseErrors errors;
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const Series series = SeriesOf(fit, unit, axis);
      if (series.rows.size() < kRowsMin || !(series.square > 0)) continue;
      const auto n = static_cast<double>(series.rows.size());
      for (std::size_t k = 0; k < forms.size(); ++k) {
        const Products sum = ProductsOf(series, forms[k], axis, &errors);
        own.fleet[k].rs += sum.rs * n / series.square;
        own.fleet[k].ss += sum.ss * n / series.square;
        if (!CanBeOf(forms[k], sum)) continue;
        const double explained = sum.rs * sum.rs / (sum.ss * series.square);
        own.most[k] = std::max(own.most[k], -n * std::log1p(-std::min(explained, 1 - 1e-12)));
      }
    }
  });
  Glances all{std::vector<double>(forms.size(), 0), std::vector<Products>(forms.size())};
  for (const Glances& own : of_chunk)
    for (std::size_t k = 0; k < forms.size(); ++k) {
      all.most[k] = std::max(all.most[k], own.most[k]);
      all.fleet[k].rs += own.fleet[k].rs, all.fleet[k].ss += own.fleet[k].ss;
    }
  return all;
}

// ---- Periods along the commanded angle.

constexpr std::size_t kBins = 131072;  // of the angle's circle, which is longer than any axis goes
constexpr double kCircle_deg = 720;
constexpr double kPeriodMin_deg = 0.02, kPeriodMax_deg = 2.5;
constexpr double kPeriods = kCircle_deg / kPeriodMin_deg;  // that can be separated, about

// The power of the units' common error, by whole periods in the circle. For noise it is chi-square
// with two degrees of freedom, halved.
std::vector<double> PowerOf(const Fit& fit, std::size_t axis) {
  std::vector<double> sums(kBins, 0);
  double square = 0;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const Series series = SeriesOf(fit, unit, axis);
    if (series.rows.size() < kRowsMin || !(series.square > 0)) continue;
    const double n = static_cast<double>(series.rows.size());
    for (std::size_t k = 0; k < series.rows.size(); ++k) {
      const double turns = series.track.cmd_deg[axis][series.rows[k].move] / kCircle_deg;
      const double value = series.weight[k] * series.rows[k].error_deg * n / series.square;
      const auto bin = static_cast<std::size_t>((turns - std::floor(turns)) * kBins) % kBins;
      sums[bin] += value, square += value * value;
    }
  }
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, sums);
  std::vector<double> power;
  for (const std::complex<double>& one : spectrum)
    power.push_back(square > 0 ? std::norm(one) / square : 0);
  return power;
}

// Adds shapes of the periods that stand out, and near them.
void AddPeriods(const Fit& fit, const Effect& effect, EffectAxis of_axis, Templates* forms) {
  constexpr std::size_t kPeaksMax = 3;
  constexpr int kEitherSide = 5;  // tenths of a period in the circle
  constexpr double kStandsOut = 18;
  const std::size_t axis = of_axis == EffectAxis::kTheta ? kTheta : kPhi;
  std::vector<double> power = PowerOf(fit, axis);
  const auto least = static_cast<std::size_t>(kCircle_deg / kPeriodMax_deg);
  const auto most = std::min(power.size() / 2, static_cast<std::size_t>(kPeriods));
  for (std::size_t peak = 0; peak < kPeaksMax; ++peak) {
    const auto at = std::max_element(power.begin() + static_cast<std::ptrdiff_t>(least),
                                     power.begin() + static_cast<std::ptrdiff_t>(most));
    if (*at < kStandsOut) return;
    const double periods = static_cast<double>(at - power.begin());
    for (int tenth = -kEitherSide; tenth <= kEitherSide; ++tenth) {
      const std::size_t listed = forms->size();
      effect.of_period(kCircle_deg / (periods + 0.1 * tenth), forms);
      for (std::size_t k = listed; k < forms->size(); ++k) (*forms)[k].choices = kPeriods;
    }
    std::fill(at - 2, at + 3, 0.0);
  }
}

}  // namespace

Templates WorthAScore(const Fit& fit, const Templates& library) {
  constexpr double kOfUnit = 30, kOfFleet = 20;  // of chi-square; chance reaches 20 or so
  constexpr std::size_t kMost = 8;               // of each axis
  std::set<std::pair<const Effect*, EffectAxis>> offered;
  for (const Template& form : library)
    if (form.effect->glance != nullptr) offered.emplace(form.effect, form.axis);
  Templates worth;
  for (const auto& [effect, of_axis] : offered) {
    Templates forms;
    effect->glance(&forms);
    for (Template& form : forms) form.choices = static_cast<double>(forms.size());
    if (effect->of_period != nullptr) AddPeriods(fit, *effect, of_axis, &forms);
    std::erase_if(forms, [&, axis = of_axis](const Template& form) { return form.axis != axis; });
    if (forms.empty()) continue;
    for (Template& form : forms) form.effect = effect;
    const Glances seen = GlanceAt(fit, forms, AxisIndex(forms.front()));
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t k = 0; k < forms.size(); ++k) {
      const Products& sum = seen.fleet[k];
      const double fleet = CanBeOf(forms[k], sum) ? sum.rs * sum.rs / sum.ss : 0;
      if (seen.most[k] > kOfUnit || fleet > kOfFleet)
        order.emplace_back(2 * std::log(forms[k].choices) - std::max(seen.most[k], fleet), k);
    }
    std::ranges::sort(order);
    if (order.size() > kMost) order.resize(kMost);
    for (const auto& [gain, k] : order) worth.push_back(forms[k]);
  }
  return worth;
}

}  // namespace focalfleet::sim
