// next_moves.csv: the moves that a diagnosis asks for, as a list that `campaign run` makes (one row
// a unit that is sent), with the conditions that each move is asked for under.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/diagnosis/ahead.h"

namespace focalfleet {

std::string WriteNextMoves(const std::vector<sim::CampaignUnit>& units,
                           const std::vector<sim::ProposedMove>& moves);

/// The list as moves of a plate of these units. Conditions that it does not tell are nominal.
/// Errors: kInvalid with file:line: a column or value missing, a unit that there is not, a unit
/// twice in one move, or conditions that differ within one.
Result<std::vector<sim::PlateMove>> ReadNextMoves(std::string_view text, std::string file,
                                                  const std::vector<sim::CampaignUnit>& units);

/// What a list of moves asks for that `campaign run` does not set, one line a column:
/// "drive_amplitude in 4 moves, first in move 7". Errors: kInvalid with file:line.
Result<std::vector<std::string>> ConditionsAsked(std::string_view text, std::string file);

}  // namespace focalfleet
