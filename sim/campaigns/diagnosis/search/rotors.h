// The cause that turned a rotor far is decided by its exact wave. At a small angle between rotor
// and field, a detent of the motor and a field that points elsewhere are both a sine of the
// motor's angle. At a large angle each bends in its own way, and the templates' few harmonics
// follow either. The waves are therefore compared by their physics.
//   detent:           U sin(lag) = t sin(n (angle - lag) + phase), the nearest rest;
//   unequal gains:    the field goes round an ellipse;
//   an offset:        the field goes round a circle beside the origin, farther off where U is
//                     smaller;
//   dead time of the bridge: a constant voltage against the current of each phase. Its direction
//                     turns in steps of 60 degrees.
// Each unit has its own strength and phase, and U is the level of the drive. A rotor in its field
// is pulled back by the sine of the angle between them (load_angle.h). The field is the sum of
// those of the three phases.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {

/// Decides the cause for each axis that has a term of either. Where it is the other one, the term
/// is exchanged for a template of that one, whose rivals are found anew. A term far from either
/// cause is unchanged. `left_out`: causes that may not be named.
void SettleRotors(const Templates& templates, const SelectionRule& rule,
                  const std::vector<std::string>& left_out, Fit* fit, Selection* selection);

/// Turns of the motor per turn of the axis, the median of the units. Pre: there are units.
double MedianGear(const CampaignModel& model, std::size_t axis);

}  // namespace focalfleet::sim
