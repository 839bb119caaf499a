// Units that carried out each other's commands: node or identity exchanged in a table, plugs
// exchanged on the plate. The fibre over A's base is then where A's own arms lead with the angles
// commanded to B. One such coincidence is worth little (a spot anywhere in a patrol area of 850
// mm^2 meets a gate of 0.1 mm^2 of one of a hundred other commands once in a hundred times); two
// that close a ring, A as B and B as A, are worth its square.
//
// Angles are absolute, so an exchange that stands since earlier moves is found in each of them. Two
// units commanded to the same angles are where they should be, exchanged or not: that cannot be
// seen.
#pragma once

#include <span>
#include <vector>

#include "fleet/camera/identify.h"
#include "fleet/camera/mapping.h"

namespace focalfleet {

/// The spot is where `unit` would be with the command of `other`.
struct SwapTrace {
  std::uint32_t unit = 0;
  std::uint32_t other = 0;
  std::uint32_t spot = 0;
};

struct SwapRing {
  std::vector<SwapTrace> members;  // two or more; each carried out the next one's command
  /// More than one ring fits, or each member's spot is also where it would be for a reason of its
  /// own: then nothing is decided.
  bool ambiguous = false;
};

struct SwapFindings {
  std::vector<SwapTrace> traces;
  std::vector<SwapRing> rings;  // no unit and no spot in two of them unless they are ambiguous
};

struct SwapSearch {
  const IdentificationRequest* request = nullptr;
  const IdentifyOptions* options = nullptr;
  const MappedSpots* spots = nullptr;
  const SpotGrid* grid = nullptr;        // over spots->at_fp
  std::span<const std::uint32_t> units;  // not seen where they should be, with a command
  std::span<const char> is_free;         // Shape: as the spots
  std::span<const Claim> claims;         // sorted by unit: reasons of its own
};

/// Cost: O(units * spots in reach); commands are looked up in a grid of places at one reference
/// arm, widened by what arms and zero angles differ.
SwapFindings FindSwaps(const SwapSearch& search);

}  // namespace focalfleet
