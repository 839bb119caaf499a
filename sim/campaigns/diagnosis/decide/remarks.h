// Remarks report what is odd about a campaign's data. None of it is an error, and none is passed
// over in silence.
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/campaign/repeated_places.h"
#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

/// Remarks on times that contradict the numbers of moves, and on rows that do not begin where the
/// row before ended.
std::vector<std::string> RemarksOnOrder(const CampaignFacts& facts);

std::vector<std::string> RemarksOnRepeats(const RepeatedPlaces& repeated, std::size_t rows);

/// How the camera stood in the first few frames, against the frame with most rows. `expected`: the
/// places by the model, all in one frame.
std::vector<std::string> RemarksOnFrames(const Frames& frames, const Places& expected,
                                         const Places& measured);

std::string RemarkOnSteps(const PlaceSteps& steps);

/// The shortest decimal of four digits.
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
