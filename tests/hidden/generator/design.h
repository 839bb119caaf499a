// A design is what is commanded in a campaign, and under which conditions. Designs are an ordinary
// survey, a campaign made to separate causes, or arcs from the hard stop as for a single unit on a
// bench.
#pragma once

#include <string>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/campaign.h"
#include "tests/hidden/generator/layout.h"

namespace focalfleet::hidden {

struct DesignOptions {
  std::string design = "diagnostic";  // survey, diagnostic, arcs
  PositionerType type = PositionerType::kEqualLong;
  std::size_t units = 40;
  std::size_t moves = 120;
};

/// The campaign of the seed: the same seed gives the same one. Shape: units * moves rows, move by
/// move.
Campaign MakeCampaign(const DesignOptions& options, std::uint64_t seed);

}  // namespace focalfleet::hidden
