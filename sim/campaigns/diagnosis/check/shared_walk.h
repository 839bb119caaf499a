// A shared walk is a common drift or step of all units that passes for noise with memory. Rest
// errors that the next moves take along are a random walk of each unit, and a walk can reach
// anything. Noise that remembers therefore hides what all units do together: a zero that steps or
// drifts. Independent walks would not agree, though. Where the noise remembers, the fit is compared
// with another one. In that one the noise forgets, and all units share empirical curves.
#pragma once

#include <cstdint>
#include <optional>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The structure of the common walk; nullopt where the units walk independently.
std::optional<UnknownFound> FindSharedWalk(const Fit& fit, double family_wise, std::uint64_t seed);

}  // namespace focalfleet::sim
