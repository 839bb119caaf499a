// The moves to make next: those that set the rivals of an ambiguous cause apart.
//
// Of a cause and a rival, D is what moves to come add to the chi-square of the cause's own trace
// that is left when geometry, the model's other terms and the rival, in any
// of its shapes and at any amplitude, have taken what they can. The two are confused with
// probability Phi(-sqrt(D) / 2): D = 10.8 is 5 %, 21.6 is 1 %, 38 is 0.1 %. Blocks of moves (out
// and back by one length, staircases, arcs, exposures at rest, each with a lever: drive, delay,
// elevation, how many move, a homing) join one by one: who takes most probability of confusion away
// in a second. A block's worth hardly grows as others join, so that only the best few are looked at
// again. Source: [HunterReiner1965], [AtkinsonFedorov1975] (T-optimality); [Minoux1978] (lazy
// greedy).
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/ahead.h"
#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

inline constexpr std::size_t kNextMovesMax = 48;

/// What to make next. None where nothing is confusable, or no move of units tells it apart.
/// `causes`: as they are told, with their candidates. Cost: some hundred looks at a few units.
NextMoves ProposeMoves(const Fit& fit, const std::vector<CauseFound>& causes);

/// Probability that two causes are confused that differ by this chi-square.
double ConfusionAt(double d);

}  // namespace focalfleet::sim
