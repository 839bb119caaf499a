// The fit of a model to a campaign has residuals, their noise (whiten.h), robust weights, and
// Gauss-Newton steps of everything at once. Static geometry and the amplitudes that are a unit's
// own are eliminated unit by unit (Schur complement). A step therefore costs O(rows) and one small
// dense system of the amplitudes that units share.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/model/static_geometry.h"
#include "sim/campaigns/diagnosis/model/whiten.h"

namespace focalfleet::sim {

/// A fit in progress. Rows without a measured place, or set aside, have weight 0.
struct Fit {
  const CampaignFacts* facts = nullptr;
  CampaignModel model;
  std::vector<double> x_um, y_um;  // Shape: (rows): measured less predicted
  std::vector<double> weight;      // Shape: (rows)
  std::vector<char> aside;         // Shape: (rows): never used in a fit
  Noise noise;
  GeometryIs geometry_is = GeometryIs::kAnywhere;
  bool has_discrepancy = true;  // whether terms bring what their shapes may differ by
  ParallelFor parallel;

  [[nodiscard]] bool Used(std::size_t row) const { return weight[row] > 0; }
  /// Whether any row of the unit is used.
  [[nodiscard]] bool UsesUnit(std::size_t unit) const {
    const std::vector<std::size_t>& first = facts->campaign->first_row;
    for (std::size_t row = first[unit]; row < first[unit + 1]; ++row)
      if (Used(row)) return true;
    return false;
  }
};

/// A fit at the table's geometry, with each unit's static geometry found robustly, also where zeros
/// are far off. Errors in the data stay residuals.
Fit StartFit(const CampaignFacts& facts, CampaignModel model, std::vector<char> aside,
             ParallelFor parallel);

/// Median distance of the used rows from their predicted places.
double MedianMiss_um(const Fit& fit);

void UpdateResiduals(Fit* fit);
void UpdateNoise(Fit* fit);    // from the present residuals
void UpdateWeights(Fit* fit);  // from residuals and noise

/// Makes a Gauss-Newton step of geometry and all amplitudes, then updates the residuals.
void StepFit(Fit* fit);

/// Repeats noise, weights and a step in turn, `rounds` times, and ends with noise and weights.
void SettleFit(Fit* fit, int rounds);

/// Fits a model whose terms or events were changed: a step, as amplitudes are linear, and two
/// rounds of SettleFit for weights and noise. Other numbers of rounds have not been measured.
void FitAnew(Fit* fit);

/// Lets the zeros differ from homing to homing, and fits them.
void FreeHomings(Fit* fit);

/// 2 ln L of the fit less a price for its parameters (-BIC); comparable between fits of one
/// campaign.
double NegativeBic(const Fit& fit);
/// The number of parameters that have been fitted beside the static geometry, and BIC's price for
/// them.
double CountParameters(const Fit& fit);
double PriceOf(const Fit& fit);

/// The static geometry's covariance in mm and degrees, with the unit's own terms fitted beside it.
StaticMatrix StaticCovariance(const Fit& fit, std::size_t unit);

}  // namespace focalfleet::sim
