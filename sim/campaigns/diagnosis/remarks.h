// Remarks on what is odd about a campaign's data: none is an error, and none shall be passed over
// in silence.
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/campaign/repeated_places.h"
#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

/// Times against numbers of moves; rows that do not begin where the row before ended.
std::vector<std::string> RemarksOnOrder(const CampaignFacts& facts);

std::vector<std::string> RemarksOnRepeats(const RepeatedPlaces& repeated, std::size_t rows);

std::string RemarkOnSteps(const PlaceSteps& steps);

/// Shortest decimal of four digits.
std::string FourDigits(double value);

/// "7, 9, 12 and 3 more".
template <class Number>
std::string FirstOf(const std::vector<Number>& numbers) {
  constexpr std::size_t kShown = 5;
  std::string text;
  for (std::size_t k = 0; k < numbers.size() && k < kShown; ++k)
    text += (k == 0 ? "" : ", ") + std::to_string(numbers[k]);
  return numbers.size() > kShown
             ? text + " and " + std::to_string(numbers.size() - kShown) + " more"
             : text;
}

}  // namespace focalfleet::sim
