// What turned a rotor far. While the angle between rotor and field is small, a detent of the motor
// and a field that points elsewhere are both a sine of the motor's angle; where it is large, each
// bends in its own way, and the templates' few harmonics follow either. So the waves are held
// against each other as physics has them:
//   detent:           U sin(lag) = t sin(n (angle - lag) + phase), the rest that is nearest;
//   unequal gains:    the field goes round an ellipse;
//   an offset:        round a circle beside the origin, the more so the smaller U is;
//   the bridge's dead time: the same off the voltage against each phase's current, which turns in
//                     steps of 60 degrees;
// with a strength and a phase of each unit, and U the level of the drive. A rotor in its field is
// pulled back by the sine of the angle between them (load_angle.h); the field is the sum of what
// the three phases make.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Of each axis the cause of its rotors' waves, where they are large enough to tell; else empty.
using RotorCauses = std::array<std::string_view, 2>;

/// Asks it of the axes that have a term of either. Where the other one it is, the term is exchanged
/// for a template of that one, whose rivals are sought anew. What is far from either is left as it
/// is. `left_out`: causes that may not be named.
RotorCauses SettleRotors(const Templates& templates, const SelectionRule& rule,
                         const std::vector<std::string>& left_out, Fit* fit, Selection* selection);

/// Turns of the motor per turn of the axis, of the units in the middle. Pre: there are units.
double MedianGear(const CampaignModel& model, std::size_t axis);

/// Where the rotor comes to rest beside the commanded angle. Unit: degrees, electrical.
/// `detent`: of the pull-out torque at this drive. `wave_deg`: n times the angle, and a phase.
double DetentError(double harmonic, double wave_deg, double detent);

}  // namespace focalfleet::sim
