// The fit of a model to a campaign: residuals, their noise, robust weights, and Gauss-Newton steps
// of everything at once. Static geometry and the amplitudes that are a unit's own are eliminated
// unit by unit (Schur complement), so that a step costs O(rows) and one small dense system of the
// amplitudes that units share.
//
// Noise is whiten.h's.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/static_geometry.h"
#include "sim/campaigns/diagnosis/whiten.h"

namespace focalfleet::sim {

/// A fit in progress. Rows without a measured place, or set aside, have weight 0.
struct Fit {
  const CampaignFacts* facts = nullptr;
  CampaignModel model;
  std::vector<double> x_um, y_um;  // Shape: (rows): measured less predicted
  std::vector<double> weight;      // Shape: (rows)
  std::vector<char> aside;         // Shape: (rows): never used in a fit
  Noise noise;
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

/// Starts from the table's geometry: finds each unit's static geometry robustly, also where zeros
/// are far off. Errors in the data stay residuals.
Fit StartFit(const CampaignFacts& facts, CampaignModel model, std::vector<char> aside,
             ParallelFor parallel);

void UpdateResiduals(Fit* fit);
void UpdateNoise(Fit* fit);    // by the present residuals
void UpdateWeights(Fit* fit);  // by residuals and noise

/// One Gauss-Newton step of geometry and all amplitudes, then residuals anew.
void StepFit(Fit* fit);

/// Steps, noise and weights in turn until the amplitudes rest.
void SettleFit(Fit* fit, int rounds);

/// Lets the zeros differ from homing to homing, and fits them.
void FreeHomings(Fit* fit);

/// 2 ln L of the fit less a price for its parameters (BIC); comparable between fits of one
/// campaign.
double NegativeBic(const Fit& fit);
/// The parameters that have been fitted beside the static geometry, and BIC's price for them.
double CountParameters(const Fit& fit);
double PriceOf(const Fit& fit);

/// Static geometry's covariance in mm and degrees, with the unit's own terms beside it.
StaticMatrix StaticCovariance(const Fit& fit, std::size_t unit);

}  // namespace focalfleet::sim
