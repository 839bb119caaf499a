// Far angles: where an axis is off by tens of degrees, the way on the plate is an arc, and a chord
// says little of it. The residual is then taken of the angles: the ones that reach the place which
// was seen, less the predicted ones, times the turn of the fibre per degree.
#pragma once

#include <vector>

#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

/// Angles that the unit has at a place, nearest to the predicted ones, and whether it reaches the
/// place. A place beyond the arms by rounding or noise is reached by the stretched arm.
struct AnglesToPlace {
  double theta_deg = 0, phi_deg = 0;
  bool reached = false;
};
AnglesToPlace FindAngles(const CampaignUnit& unit, double x_mm, double y_mm, double theta_deg,
                         double phi_deg);

/// Replaces residuals of the unit's rows that are farther than half a millimetre by those of their
/// angles. theta_deg, phi_deg: predicted. Shapes: (moves); x_um, y_um (rows).
void TakeFarAngles(const UnitTrack& track, const std::vector<double>& theta_deg,
                   const std::vector<double>& phi_deg, std::vector<double>* x_um,
                   std::vector<double>* y_um);

}  // namespace focalfleet::sim
