// Rest errors that the next moves take along are a random walk of each unit, and a walk goes
// anywhere: noise that remembers leaves nothing to see of what all units do together, a zero that
// steps or drifts. But walks of their own would not agree. So where the noise remembers, noise that
// forgets and empirical curves of all units together are held against it.
#pragma once

#include <cstdint>
#include <optional>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// None: the units walk each by itself.
std::optional<UnknownFound> FindSharedWalk(const Fit& fit, double family_wise, std::uint64_t seed);

}  // namespace focalfleet::sim
