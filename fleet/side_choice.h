// A fibre reaches most places with its elbow on either side. The nearest side is taken where its
// arm is clear of the neighbours'; where it is not, other sides are tried, a few passes over all
// units. Touches that are left are decided exactly. A unit has two arms to choose from, and two
// neighbours' arms exclude one another or do not: such a choice is a 2-satisfiability problem,
// which propagation decides in linear time. If any choice of sides is clear, one is found.
// Source: Even, Itai and Shamir, SIAM J. Comput. 5 (1976) 691, section 2.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/geometry/segment.h"
#include "fleet/kinematics.h"
#include "fleet/layout.h"

namespace focalfleet {

/// The poses that one target leaves open, in the order of preference.
using PoseChoice = std::vector<Pose>;

/// Replaces poses of units that touch others. `choices`: of the units with a target, else empty.
/// `standing`: arms of units that stay where they are; empty: not known. `poses` has the first of
/// each choice. Shapes: (units). Cost: O(units) clearance tests, a few for each pair of neighbours.
void ChooseSides(const Layout& layout, std::span<const UnitDrive> drives,
                 std::vector<std::optional<SegmentFp>> standing,
                 const std::vector<PoseChoice>& choices, std::vector<std::optional<Pose>>* poses);

}  // namespace focalfleet
