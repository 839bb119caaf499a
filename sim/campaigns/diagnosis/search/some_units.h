// The model of a large fleet is found on some of its units, and then used for all.
#pragma once

#include <cstdint>

#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/score/fleet_groups.h"

namespace focalfleet::sim {

/// The fit with all units but `keep` random ones aside.
Fit SomeUnits(const Fit& fit, std::size_t keep, std::uint64_t seed);

/// Gives a term of units' own amplitudes to all units if most of the examined ones have it.
void SpreadToAll(const Fit& some, ModelTerm* term);

/// Gives shapes of their own to units that were not examined.
void GiveShapes(const Templates& library, const FleetGroups& groups, std::size_t term, Fit* fit);

}  // namespace focalfleet::sim
