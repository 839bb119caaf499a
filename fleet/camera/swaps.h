// Units that carried out each other's commands: node or identity exchanged in a table, plugs
// exchanged on the plate. The fibre over A's base is then where A's own arms lead with the angles
// commanded to B. A single such coincidence is weak evidence. A hundred other commands have gates
// of 0.1 mm^2 in a patrol area of 850 mm^2, so a spot anywhere meets one of them once in a hundred
// times. Two that close a ring, A as B and B as A, are evidence of its square.
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
  /// More than one ring fits, or each member's spot also has an explanation of its own: nothing is
  /// decided then.
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
  const SpotGrid* grid = nullptr;  // over spots->at_fp
  /// units with a command that are not seen where they should be
  std::span<const std::uint32_t> units;
  std::span<const char> is_free;  // Shape: as the spots
  std::span<const Claim> claims;  // sorted by unit: the units' other explanations
};

/// All rings of exchanged commands. Cost: O(units * spots in reach). Commands are looked up in a
/// grid of places at one reference arm, widened by what arms and zero angles differ.
SwapFindings FindSwaps(const SwapSearch& search);

}  // namespace focalfleet
