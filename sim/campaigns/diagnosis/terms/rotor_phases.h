// Rotors of neighbours pull at each other by the difference of their angles. A motor's angle is
// known from its commands but for a constant: where the rotor stood when it was built in, and what
// the axis' zero is off by, times the gear. The constants are found from all pairs at once (angular
// synchronisation). Each pair of neighbours u, v says by the residuals e of their angles
//   D_uv = sum e_u exp(i (psi_u - psi_v)) - conj(sum e_v exp(i (psi_v - psi_u)))
// and the phases p maximise the sum of |Im exp(i (p_u - p_v)) D_uv| (pitch / distance)^3.
// Source: Singer, Applied and Computational Harmonic Analysis 30, 20, 2011.
#pragma once

#include <cstdint>
#include <map>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The rotors' angles at motor angles of 0, deg, by unit_id, as the fit's residuals on the axis say
/// them. Their common part is arbitrary. Empty where no units are near each other. Chance has
/// phases, too: a template with them pays for each unit's. O(rows), and 100 rounds of O(units).
std::map<std::uint32_t, double> FindRotorPhases(const Fit& fit, std::size_t axis);

}  // namespace focalfleet::sim
