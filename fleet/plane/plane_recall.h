// The outcomes of the configuration under way, or of the last one, over all sectors. The report of
// a sector that has begun another life since counts until that life knows better: the new life
// hears of the last configuration, asks as usual, and is answered that nothing moves. The sector
// then knows, and reports, which of its units stand at their targets.
#pragma once

#include <cstdint>
#include <vector>

#include "fleet/plane/plane_state.h"

namespace focalfleet {

class PlaneRecall {
 public:
  /// `state` outlives this.
  explicit PlaneRecall(PlaneState* state)
      : state_(*state), reported_(state->plane.sectors()), parts_(state->plane.sectors()) {}

  /// A configuration begins: nothing is reported of it.
  void Begin();
  /// Brings the counts of the view up to date.
  void Count();
  /// Nothing is under way: sectors stand, and new lives hear of the last configuration. Another
  /// configuration, which the coordinator does not know, is stopped.
  void Idle();

 private:
  void Recall(std::uint32_t sector);

  PlaneState& state_;
  std::vector<OutcomeCounts> reported_;  // Shape: (sectors)
  std::vector<PlanePart> parts_;         // Shape: (sectors); that were answered
};

}  // namespace focalfleet
