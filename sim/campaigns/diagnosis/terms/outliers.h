// Outliers are rows that no smooth effect makes. Examples are units that do not move, spots that
// were not seen, and moves that did not happen. They are found, counted and named before and after
// the fit.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sim/campaigns/campaign/repeated_places.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// Finds the outliers that the table alone shows. `repeated`: rows whose places have been
/// forgotten. `aside` marks the rows that must not enter a fit.
OutliersFound FindBeforeFit(const CampaignFacts& facts, const RepeatedPlaces& repeated,
                            std::vector<char>* aside);

/// Takes rows out of all fits, and counts them.
void SetAside(const std::vector<std::size_t>& rows, const std::string& why,
              std::vector<char>* aside, OutliersFound* found);

/// Adds rows far from the final model by reason, and units that are so in many rows, or far more
/// off than others. Returns the rows.
std::vector<std::size_t> FindAfterFit(const Fit& fit, OutliersFound* found);

struct Cluster {
  UnknownFound reported;
  // Rows whose arms touched. Empty where the cluster is not where arms are nearest, or not there
  // alone.
  std::vector<std::size_t> touched;
};

/// The cluster of far rows, where they have one. Outliers that are far for reasons of their own lie
/// anywhere. A cluster at one angle, or where arms come near each other, is an effect that no term
/// has. `far`: rows. nullopt where chance explains it, at a share of the family-wise rate.
std::optional<Cluster> FindCluster(const Fit& fit, const std::vector<std::size_t>& far,
                                   double family_wise);

/// The cause of a cluster's rows, which are arms that touched and came apart again.
CauseFound TouchCause(const Fit& fit, const std::vector<std::size_t>& rows);

}  // namespace focalfleet::sim
