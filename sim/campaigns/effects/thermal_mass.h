// A thermal mass follows the measured temperature of its surroundings late.
#pragma once

#include <span>
#include <vector>

namespace focalfleet::sim {

/// Time constants to look for, a factor of three apart. 20 g of aluminium (900 J/(kg K)) with
/// 60 cm^2 in still air (5 W/(m^2 K)) take 600 s, a tenth of that in wind or on a cooled plate.
inline constexpr double kTimeConstants_s[] = {60, 200, 600};

/// The temperature of a body with the time constant `tau_s` in surroundings of `temperature_C`,
/// from rest at the first value. The surroundings change linearly between the times `time_s`.
std::vector<double> Late(std::span<const double> temperature_C, std::span<const double> time_s,
                         double tau_s);

}  // namespace focalfleet::sim
