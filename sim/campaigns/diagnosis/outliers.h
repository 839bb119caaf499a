// Rows that no smooth effect makes, found, counted and named before and after the fit: units that
// do not move, spots that were not seen, moves that did not happen.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sim/campaigns/campaign/repeated_places.h"
#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// Outliers that the table alone tells. `repeated`: rows whose places have been forgotten.
/// `aside` gets the rows that must not enter a fit.
OutliersFound FindBeforeFit(const CampaignFacts& facts, const RepeatedPlaces& repeated,
                            std::vector<char>* aside);

/// Takes rows out of all fits, and counts them.
void SetAside(const std::vector<std::size_t>& rows, const std::string& why,
              std::vector<char>* aside, OutliersFound* found);

/// Rows far from the final model, added by reason; and units that are so in many rows, or far more
/// off than others. Returns the rows.
std::vector<std::size_t> FindAfterFit(const Fit& fit, OutliersFound* found);

struct Cluster {
  UnknownFound reported;
  // Rows. {}: it is not where arms are nearest, or not there alone.
  std::vector<std::size_t> touched;
};

/// Outliers that are far for a reason of their own lie anywhere. Where they cluster at one angle,
/// or where arms come near each other, something happens there that no term has. `far`: rows. None:
/// chance puts them so, at a share of the family-wise rate.
std::optional<Cluster> FindCluster(const Fit& fit, const std::vector<std::size_t>& far,
                                   double family_wise);

/// Arms that touched and came apart again: what a cluster's rows are.
CauseFound TouchCause(const Fit& fit, const std::vector<std::size_t>& rows);

}  // namespace focalfleet::sim
