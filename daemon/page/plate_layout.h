// The layout as a page draws it: units with their places, arms and buses, as columns of equal
// length.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "fleet/layout.h"

namespace focalfleet {

/// {units: {id, x_mm, y_mm, arm_theta_mm, arm_phi_mm, half_width_mm, patrol_min_mm, patrol_max_mm,
/// bus, node, rail}, obstacles: [{id, x_mm, y_mm, radius_mm}], pitch_mm}, in the order in which
/// frames have the units. A column whose values are all equal is one number. `sectors` has the
/// sector of each unit of a plane, which is a column more; empty: there are none.
std::string LayoutJson(const Layout& layout, std::span<const std::uint32_t> sectors = {});

}  // namespace focalfleet
