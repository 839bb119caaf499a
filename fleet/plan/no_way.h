// The reason why a unit cannot be served, as a proof and not as a search that gave up. The unit's
// square of angles is cut into boxes. A box counts as closed only where every pose in it is too
// near to one thing that never moves. The poses that can be reached through boxes that are not
// closed include all poses that can be reached. Where even those do not include the target, no way
// exists, however all others move. A proof on a coarse grid is as good as one on a fine grid; fine
// grids find narrower walls.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

struct NoWayQuestion {
  const ArmGeometry* arm = nullptr;
  std::span<const Blocker> never_move;  // needs: the least that the rule asks
  Pose from{};
  Pose to{};
};

/// The proof. Empty: the boxes are not enough for one. Cost: O(boxes * blockers), a tenth of a
/// second at the finest.
std::optional<NoWay> ProveNoWay(const NoWayQuestion& question);

}  // namespace focalfleet
