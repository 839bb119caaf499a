// Places that are no measurements: the row repeats the place that the unit had before, to the last
// digit. A pipeline that fills in what it did not measure does that where a unit was not moved, and
// a camera that is read twice does it to a whole exposure. Counted as evidence they would say that
// the noise is nothing.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

struct RepeatedPlaces {
  std::vector<std::size_t> carried_on;  // rows of units that were not moved; ascending
  std::vector<std::size_t> copied;      // rows of exposures that repeat the one before; ascending
  std::vector<std::int64_t> copies;     // move_id of these exposures
  [[nodiscard]] bool empty() const { return carried_on.empty() && copied.empty(); }
};

/// Places of units at rest repeat by chance, too, where they come in steps: none of them is carried
/// on unless more do than that explains. An exposure is a copy where half of the units that were
/// moved by more than 0.1 mm, three at least, repeat their place, or all do, however little they
/// were moved.
RepeatedPlaces FindRepeatedPlaces(const Campaign& campaign);

/// The same, and these places are missing from then on.
RepeatedPlaces ForgetRepeatedPlaces(Campaign* campaign);

}  // namespace focalfleet::sim
