// A library's shape of a cause is never quite the true one. The misfit of a strong cause looks like
// other causes, and no threshold of chance protects from it, because the misfit is certain. Each
// term therefore brings the distortions that its true shape may have: it has another amplitude in
// each unit, bends where it is large, and depends on the direction of the move, on the axis' angle
// or on the drive. Their amplitudes have a normal prior of the effect's relative discrepancy
// (Effect::discrepancy), and are fitted with everything else. Their share of the data is no
// evidence for another cause.
// Source: Kennedy and O'Hagan, J. R. Statist. Soc. B 63 (2001) 425, with a basis of few columns in
// place of a Gaussian process.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// Makes the distortions of the fit's terms at their present amplitudes, with amplitudes of 0,
/// where those that the fit has are of other terms or other amplitudes. Returns whether it did.
bool RenewDiscrepancies(Fit* fit);

/// Takes distortions out that are not of the terms that the fit has now.
void DropStaleDiscrepancies(Fit* fit);

/// Takes the distortions out of the fit for good.
void LeaveOutDiscrepancies(Fit* fit);

/// Sets `columns` to the whitened displacements of the unit by each distortion at an amplitude of
/// one, for a unit that has the term. Shape: (2 moves, distortions).
void DistortionColumns(const WhiteUnit& white, const Discrepancy& discrepancy,
                       Eigen::MatrixXd* columns);

/// Sets the spread of each term's distortions to what their amplitudes have, with the effect's own
/// discrepancy as the prior (empirical Bayes, one step of EM). A shape that is right pays little.
void UpdateSpreads(CampaignModel* model);

/// The price of the distortions in units of 2 ln L: the Laplace approximation of their marginal
/// likelihood, with prior and fitted precision.
double PriceOfDiscrepancies(const CampaignModel& model);

}  // namespace focalfleet::sim
