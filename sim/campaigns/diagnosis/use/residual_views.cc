#include "sim/campaigns/diagnosis/use/residual_views.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "sim/campaigns/diagnosis/model/angle_errors.h"
#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

// The numbers of this file choose what is drawn. No verdict depends on any of them.

constexpr double kNotKnown = HeldOutGain::kNotKnown;

/// Adds the bin of the points first .. last - 1. Pre: ordered by x, not empty.
void AddBin(std::span<const std::pair<double, double>> points, MedianCurve* curve) {
  std::vector<double> y;
  double x = 0;
  for (const auto& [px, py] : points) x += px, y.push_back(py);
  // Share beyond either bound. Between the bounds lie two thirds, 0.97 sigma of normal errors to
  // either side. Half of it widens the bounds to 1.38 sigma, twice of it narrows them to 0.43.
  constexpr double kTail = 1.0 / 6;
  curve->x.push_back(x / static_cast<double>(points.size()));
  curve->median.push_back(Median(y));
  curve->low.push_back(Quantile(y, kTail));
  curve->high.push_back(Quantile(y, 1 - kTail));
}

/// `sigma`: of each median.
double StructureOf(std::span<const double> medians, std::span<const double> sigma) {
  double sum = 0, weights = 0;
  for (std::size_t k = 0; k < medians.size(); ++k) {
    const double weight = 1 / (sigma[k] * sigma[k]);
    sum += weight * medians[k], weights += weight;
  }
  double chi_square = 0;
  for (std::size_t k = 0; k < medians.size(); ++k)
    chi_square += std::pow((medians[k] - sum / weights) / sigma[k], 2);
  const auto bins = static_cast<double>(medians.size());
  return (chi_square - (bins - 1)) / bins;
}

// Periods a turn between two orders. A sine halfway loses 1 - sinc(step / 2) of its amplitude over
// a whole turn: 10 %. Half of the step loses 3 % at twice the cost, twice of it 36 %.
constexpr double kOrderStep = 0.5;

std::vector<double> OrdersOf(double gear) {
  // Periods a turn, where the gear is not known. The last stage's ring has the highest order of
  // teeth, 121.8 (harmonic.h). Half of it would cut teeth off, twice of it shows nothing more.
  constexpr double kTeethMost = 130;
  const double continuous =
      std::isfinite(gear) && gear > 0 ? std::min(1.03 * gear, 400.0) : kTeethMost;
  std::vector<double> orders;
  for (double order = 1; order < continuous; order += kOrderStep) orders.push_back(order);
  if (!std::isfinite(gear) || gear <= 0) return orders;
  for (const double harmonic : {1.0, 2.0, 6.0}) {
    const double middle = harmonic * gear;
    if (middle < continuous) continue;
    orders.push_back(kNotKnown);  // the curve has a gap
    for (double order = middle - 3; order <= middle + 3; order += kOrderStep)
      orders.push_back(order);
  }
  return orders;
}

/// Adds to `power` the squared amplitude of each order in one unit's errors, times its rows; the
/// result is those rows.
double AddPower(std::span<const double> angle_deg, std::span<const double> error_deg,
                std::span<const double> orders, std::vector<double>* power, double* chance) {
  double sum = 0, count = 0;
  for (const double error : error_deg)
    if (std::isfinite(error)) sum += error, ++count;
  // Seen rows of a unit. A diagnosis asks for as many moves. With half of them a sine and a mean
  // leave one degree of freedom; twice as many leave short campaigns without a spectrum.
  constexpr double kRowsMin = 8;
  if (count < kRowsMin) return 0;
  const double mean = sum / count;
  double square = 0;
  std::vector<std::complex<double>> waves(orders.size());
  for (std::size_t i = 0; i < error_deg.size(); ++i) {
    if (!std::isfinite(error_deg[i])) continue;
    const double error = error_deg[i] - mean;
    square += error * error;
    const double angle = angle_deg[i] * std::numbers::pi / 180;
    const std::complex<double> turn = std::polar(1.0, -kOrderStep * angle);
    std::complex<double> pointer;
    for (std::size_t k = 0; k < orders.size(); ++k) {
      // The pointer turns from order to order. Set anew now and then, it keeps its digits.
      const bool follows = k % 64 != 0 && std::abs(orders[k] - orders[k - 1] - kOrderStep) < 1e-9;
      pointer = follows ? pointer * turn : std::polar(1.0, -orders[k] * angle);
      waves[k] += error * pointer;
    }
  }
  for (std::size_t k = 0; k < orders.size(); ++k)
    (*power)[k] += count * std::norm(2.0 / count * waves[k]);
  *chance += count * 4 * square / count / count;
  return count;
}

}  // namespace

AngleResiduals AngleResidualsOf(const CampaignFacts& facts, const Diagnosis& diagnosis) {
  const Campaign& campaign = *facts.campaign;
  AngleResiduals out;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    out.before_deg[axis].assign(campaign.rows(), kNotKnown);
    out.after_deg[axis].assign(campaign.rows(), kNotKnown);
  }
  if (diagnosis.x_before_um.size() != campaign.rows()) return out;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const CampaignUnit& geometry =
        unit < diagnosis.model.units.size() ? diagnosis.model.units[unit] : campaign.units[unit];
    const UnitTrack track = MakeTrack(facts, unit, geometry);
    for (std::size_t i = 0; i < track.moves; ++i) {
      const std::size_t row = track.first_row + i;
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto put = [&](const std::vector<double>& x_um, const std::vector<double>& y_um,
                             std::vector<double>* to) {
          if (!std::isfinite(x_um[row]) || !std::isfinite(y_um[row])) return;
          if (const auto found = AngleErrorAt(track, i, axis, x_um[row], y_um[row]))
            (*to)[row] = found->error_deg;
        };
        put(diagnosis.x_before_um, diagnosis.y_before_um, &out.before_deg[axis]);
        put(diagnosis.x_after_um, diagnosis.y_after_um, &out.after_deg[axis]);
      }
    }
  }
  return out;
}

MedianCurve MedianAlong(std::span<const double> x, std::span<const double> y) {
  // Bins of a curve some 300 pixels wide: half as many hide a step, twice as many draw noise. A
  // median of 12 points is known to 0.36 sigma, one of 6 to 0.51, one of 24 to 0.26.
  constexpr std::size_t kBinsMax = 32, kPointsMin = 12;
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < x.size(); ++i)
    if (std::isfinite(x[i]) && std::isfinite(y[i])) points.emplace_back(x[i], y[i]);
  std::ranges::sort(points);
  MedianCurve curve;
  if (points.empty()) return curve;
  const std::size_t least = std::max(kPointsMin, points.size() / kBinsMax);
  std::vector<double> sigma;
  for (std::size_t first = 0; first < points.size();) {
    std::size_t last = std::min(first + least, points.size());
    // Too few points for a bin join the last one.
    if (points.size() - last < least / 2) last = points.size();
    while (last < points.size() && points[last].first == points[last - 1].first) ++last;
    AddBin(std::span(points).subspan(first, last - first), &curve);
    // The error of a median of normal numbers against that of their mean.
    const double of_median = std::sqrt(std::numbers::pi / 2);
    const double half = (curve.high.back() - curve.low.back()) / 2;
    sigma.push_back(
        std::max(of_median * half / std::sqrt(static_cast<double>(last - first)), 1e-12));
    first = last;
  }
  curve.structure = StructureOf(curve.median, sigma);
  return curve;
}

OrderSpectrum SpectrumOf(const Campaign& campaign, const AngleResiduals& residuals,
                         std::size_t axis) {
  OrderSpectrum out;
  if (campaign.units.empty()) return out;
  out.order = OrdersOf(campaign.units.front().gear[axis]);
  out.before_deg.assign(out.order.size(), 0);
  out.after_deg.assign(out.order.size(), 0);
  const std::size_t stride = (campaign.rows() + kSpectrumRows - 1) / kSpectrumRows;
  double rows = 0, chance = 0, unused = 0;
  for (std::size_t unit = 0; unit < campaign.units.size();
       unit += std::max<std::size_t>(1, stride)) {
    const std::size_t first = campaign.first_row[unit];
    const std::size_t count = campaign.first_row[unit + 1] - first;
    const auto of = [&](const std::vector<double>& column) {
      return std::span(column).subspan(first, count);
    };
    const std::span<const double> angles = of(campaign.cmd_deg[axis]);
    AddPower(angles, of(residuals.before_deg[axis]), out.order, &out.before_deg, &unused);
    rows += AddPower(angles, of(residuals.after_deg[axis]), out.order, &out.after_deg, &chance);
  }
  if (rows == 0) return {};
  for (std::vector<double>* power : {&out.before_deg, &out.after_deg})
    for (double& one : *power) one = std::sqrt(one / rows);
  out.chance_deg = std::sqrt(chance / rows);
  return out;
}

UnitResiduals UnitResidualsOf(const Campaign& campaign, const Diagnosis& diagnosis) {
  const auto rms = [&](const std::vector<double>& x, const std::vector<double>& y) {
    std::vector<double> out(campaign.units.size(), kNotKnown);
    if (x.size() != campaign.rows()) return out;
    for (std::size_t unit = 0; unit < out.size(); ++unit) {
      double square = 0, count = 0;
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
        if (std::isfinite(x[row]) && std::isfinite(y[row]))
          square += x[row] * x[row] + y[row] * y[row], ++count;
      if (count > 0) out[unit] = std::sqrt(square / count);
    }
    return out;
  };
  return {rms(diagnosis.x_before_um, diagnosis.y_before_um),
          rms(diagnosis.x_after_um, diagnosis.y_after_um)};
}

std::optional<std::uint32_t> WorstExposure(const CampaignFacts& facts, const Diagnosis& diagnosis) {
  if (diagnosis.x_before_um.size() != facts.campaign->rows()) return std::nullopt;
  std::vector<std::vector<double>> lengths(facts.exposures.size());
  for (std::size_t row = 0; row < facts.campaign->rows(); ++row) {
    const double um = std::hypot(diagnosis.x_before_um[row], diagnosis.y_before_um[row]);
    if (std::isfinite(um)) lengths[facts.exposures.of_row[row]].push_back(um);
  }
  std::size_t most = 0;
  for (const std::vector<double>& of : lengths) most = std::max(most, of.size());
  // Share of the units of the fullest exposure. With half of it a few strays may make the picture,
  // with all of them a lost spot rules an exposure out.
  constexpr double kNearlyAll = 0.8;
  std::optional<std::uint32_t> worst;
  double worst_um = -1;
  for (std::uint32_t exposure = 0; exposure < lengths.size(); ++exposure) {
    const std::vector<double>& of = lengths[exposure];
    if (of.empty() || static_cast<double>(of.size()) < kNearlyAll * static_cast<double>(most))
      continue;
    const double median_um = Median(of);
    if (median_um > worst_um) worst = exposure, worst_um = median_um;
  }
  return worst;
}

}  // namespace focalfleet::sim
