// next_moves.csv lists the moves that a diagnosis asks for, in the form that `campaign run` makes
// (one row for each unit that is sent). Each move carries the conditions under which it is to be
// made.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/diagnosis/design/ahead.h"

namespace focalfleet {

std::string WriteNextMoves(const std::vector<sim::CampaignUnit>& units,
                           const std::vector<sim::ProposedMove>& moves);

/// The list as moves of a plate of these units. Conditions that the list does not give are nominal.
/// Errors: kInvalid with file:line: a column or value is missing, a unit does not exist or stands
/// twice in one move, or conditions differ within one move.
Result<std::vector<sim::PlateMove>> ReadNextMoves(std::string_view text, std::string file,
                                                  const std::vector<sim::CampaignUnit>& units);

/// Conditions in a list of moves that `campaign run` does not set, one line for each column:
/// "drive_amplitude in 4 moves, first in move 7".
/// Errors: kInvalid with file:line.
Result<std::vector<std::string>> ConditionsAsked(std::string_view text, std::string file);

}  // namespace focalfleet
