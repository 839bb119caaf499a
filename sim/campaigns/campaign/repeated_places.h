// Some places are no measurements: their row repeats the place that the unit had before, to the
// last digit. A pipeline that fills in missing measurements does that where a unit was not moved. A
// camera that is read twice does it to a whole exposure. Counted as measurements such rows would
// make the noise look like nothing.
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

/// Finds the places that repeat. Places of units at rest also repeat by chance where they come in
/// steps. None of them counts as carried on unless more do than chance explains. An exposure is a
/// copy where half of the units that were moved by more than 0.1 mm, three at least, repeat their
/// place. The same holds where all units do, however little they were moved.
RepeatedPlaces FindRepeatedPlaces(const Campaign& campaign);

/// Finds the places that repeat and sets them to missing.
RepeatedPlaces ForgetRepeatedPlaces(Campaign* campaign);

}  // namespace focalfleet::sim
