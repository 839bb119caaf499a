// Rows that no smooth effect makes, found, counted and named before and after the fit: units that
// do not move, spots that were not seen, moves that did not happen, fibres under another's name.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {

/// What can be told from the table alone. `aside` gets the rows that must not enter a fit.
OutliersFound FindBeforeFit(const CampaignFacts& facts, std::vector<char>* aside);

/// Pairs of units whose measured places belong to each other, for all of the campaign.
std::vector<std::pair<std::size_t, std::size_t>> FindSwaps(const Fit& fit);

/// The exchanged names as a cause. Pre: not empty.
CauseFound SwapCause(const Campaign& campaign,
                     const std::vector<std::pair<std::size_t, std::size_t>>& swaps);

/// Exchanges the measured places of two units where both were measured in one exposure; rows of
/// only one become missing.
void UndoSwap(const Exposures& exposures, std::size_t a, std::size_t b, Campaign* campaign);

/// Rows far from the final model, added by reason. Returns them.
std::vector<std::size_t> FindAfterFit(const Fit& fit, OutliersFound* found);

/// Outliers that are far for a reason of their own lie anywhere. Where they crowd at one angle, or
/// where arms come near each other, something happens there that no term has. `far`: rows. None:
/// chance puts them so, at a share of the family-wise rate.
std::optional<UnknownFound> FindCrowd(const Fit& fit, const std::vector<std::size_t>& far,
                                      double family_wise);

}  // namespace focalfleet::sim
