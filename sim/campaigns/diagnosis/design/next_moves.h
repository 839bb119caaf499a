// The moves to make next are those that separate the rivals of an ambiguous cause.
//
// D of a cause and a rival is a part of the chi-square of the cause's own trace in moves to come.
// Geometry, the model's other terms and the rival, in any of its shapes and at any amplitude, take
// what they can of that trace. D is what is left. The two are confused with probability
// Phi(-sqrt(D) / 2): D = 10.8 is 5 %, 21.6 is 1 %, 38 is 0.1 %.
//
// Moves come in blocks: out and back by one length, staircases, arcs, exposures at rest. A block
// may change a condition: drive, delay, elevation, how many units move, a homing. The next block is
// the one that removes most probability of confusion per second. A block's worth hardly grows as
// others join, so that only the best few are examined again. Source: [HunterReiner1965],
// [AtkinsonFedorov1975] (T-optimality); [Minoux1978] (lazy greedy).
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/design/ahead.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

inline constexpr std::size_t kNextMovesMax = 48;

/// The moves to make next. Empty where no cause is ambiguous, or where no move of units separates
/// it. `causes`: as reported, with their candidates. Cost: some hundred evaluations of a few units.
NextMoves ProposeMoves(const Fit& fit, const std::vector<CauseFound>& causes);

/// Probability that two causes are confused that differ by this chi-square.
double ConfusionAt(double d);

}  // namespace focalfleet::sim
