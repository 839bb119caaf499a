// Structure that no candidate explains. The residuals of the selected model are compared with
// smooth functions of the known covariates of each reading, sensor by sensor. Each family is one
// F-like test.

#include <algorithm>
#include <cmath>

#include "sim/hall/diagnosis/findings.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kChanceMax = 1e-5;

std::vector<double> Smooth(double x) {  // x in -1..1
  return {x, x * x, std::sin(3 * x), std::cos(3 * x), std::sin(6 * x), std::cos(6 * x)};
}

// The squares that functions of one covariate explain, each sensor with its own.
double ExplainedBy(const std::vector<double>& covariate, const HallSearch& search,
                   const VectorXd& residuals, std::size_t sensors, std::size_t* freedom) {
  double low = 1e300, high = -1e300;
  for (const Reading& reading : search.readings()) {
    low = std::min(low, covariate[reading.row]);
    high = std::max(high, covariate[reading.row]);
  }
  *freedom = 0;
  if (!(high > low)) return 0;
  double explained = 0;
  for (std::size_t s = 0; s < sensors; ++s) {
    std::vector<std::size_t> own;
    for (std::size_t k = 0; k < search.readings().size(); ++k)
      if (search.readings()[k].sensor == s) own.push_back(k);
    if (own.size() < 15) continue;
    const auto functions = static_cast<Index>(Smooth(0).size());
    MatrixXd basis(static_cast<Index>(own.size()), functions + 1);
    VectorXd rest(static_cast<Index>(own.size()));
    for (std::size_t k = 0; k < own.size(); ++k) {
      const double x = 2 * (covariate[search.readings()[own[k]].row] - low) / (high - low) - 1;
      const std::vector<double> values = Smooth(x);
      const auto row = static_cast<Index>(k);
      basis(row, 0) = 1;
      for (Index f = 0; f < functions; ++f) basis(row, f + 1) = values[static_cast<std::size_t>(f)];
      rest[row] = residuals[static_cast<Index>(own[k])];
    }
    const VectorXd solution = basis.colPivHouseholderQr().solve(rest);
    explained += rest.squaredNorm() - (rest - basis * solution).squaredNorm();
    *freedom += static_cast<std::size_t>(functions) + 1;
  }
  return explained;
}

// A common scale for all sensors of a pose is the effect of an unseen temperature.
double ExplainedByScales(const HallForward& forward, const HallSearch& search,
                         const Selected& selected, std::size_t rows, std::size_t* freedom) {
  std::vector<double> top(rows, 0), bottom(rows, 0);
  VectorXd predicted;
  forward.Predict(selected.fit.parameters, search.readings(), &predicted);
  const double zero_V = forward.zero_V();
  for (std::size_t k = 0; k < search.readings().size(); ++k) {
    const auto i = static_cast<Index>(k);
    const double signal = predicted[i] - zero_V;
    top[search.readings()[k].row] += signal * selected.fit.residuals[i];
    bottom[search.readings()[k].row] += signal * signal;
  }
  double explained = 0;
  *freedom = 0;
  for (std::size_t r = 0; r < rows; ++r)
    if (bottom[r] > 0) {
      explained += top[r] * top[r] / bottom[r];
      ++*freedom;
    }
  return explained;
}

}  // namespace

std::vector<HallUnknown> RemainingStructure(const HallForward& forward,
                                            const HallCampaign& campaign, const HallSearch& search,
                                            const Selected& selected) {
  const std::size_t rows = campaign.rows.size();
  std::vector<std::pair<std::string, std::vector<double>>> covariates = {
      {"alpha_deg", {}}, {"beta_deg", {}}, {"gamma_deg", {}}, {"row", {}}};
  for (std::size_t r = 0; r < rows; ++r) {
    covariates[0].second.push_back(campaign.poses[r].alpha_rad);
    covariates[1].second.push_back(campaign.poses[r].beta_rad);
    covariates[2].second.push_back(std::remainder(campaign.poses[r].gamma_rad, 1.5707963267948966));
    covariates[3].second.push_back(static_cast<double>(r));
  }
  if (campaign.has_temperature) {
    covariates.push_back({"temp_C", {}});
    for (const VoltageRow& row : campaign.rows)
      covariates.back().second.push_back(
          std::isfinite(row.temperature_C) ? row.temperature_C : campaign.temperature_mean_C);
  }
  const VectorXd& residuals = selected.fit.residuals;
  const auto n = static_cast<double>(residuals.size());
  std::vector<HallUnknown> unknown;
  const auto judge = [&](const std::string& name, double explained, std::size_t freedom) {
    if (freedom == 0) return;
    // The explained squares are compared with the rest; the fit has taken its own share of that.
    const double left = n - static_cast<double>(freedom + selected.fit.free.size());
    const double variance =
        std::max((residuals.squaredNorm() - explained) / std::max(left, 1.0), 2.5e-9);
    const double p = ChanceOf(explained / variance * left / (left + 2.0), freedom);
    if (p < kChanceMax) unknown.push_back({name, p, std::sqrt(std::max(0.0, explained) / n)});
  };
  for (const auto& [name, values] : covariates) {
    std::size_t freedom = 0;
    const double explained =
        ExplainedBy(values, search, residuals, forward.layout().sensors, &freedom);
    judge(name, explained, freedom);
  }
  std::size_t freedom = 0;
  const double scales = ExplainedByScales(forward, search, selected, rows, &freedom);
  judge("a factor common to all sensors of a pose", scales, freedom);
  std::sort(unknown.begin(), unknown.end(),
            [](const HallUnknown& a, const HallUnknown& b) { return a.rms_V > b.rms_V; });
  return unknown;
}

}  // namespace focalfleet::sim
