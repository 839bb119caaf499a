// A thermal mass follows the measured temperature of its surroundings late.
#pragma once

#include <span>
#include <vector>

namespace focalfleet::sim {

/// Time constants to look for: those between are found from these. A carrier of a few grams in air
/// takes minutes.
inline constexpr double kTimeConstants_s[] = {60, 200, 600};

/// The temperature of a body with the time constant `tau_s` in surroundings of `temperature_C`,
/// from rest at the first value. The surroundings change linearly between the times `time_s`.
std::vector<double> Late(std::span<const double> temperature_C, std::span<const double> time_s,
                         double tau_s);

}  // namespace focalfleet::sim
