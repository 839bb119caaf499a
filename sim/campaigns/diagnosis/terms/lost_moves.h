// Lost moves are whole commands, of both axes, that a unit did not make. exact_steps.h finds those
// that are large. Where some are known, others are as likely as they are frequent: a smaller one,
// which looks like stiction or a mode of short moves, is taken where its probability is 0.9.
#pragma once

#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// Whether the step is the whole command of its move, lost or made twice.
bool IsCommand(const Fit& fit, const EventTerm& event);

/// The log likelihood ratio that a lost move has to exceed, where so many are known among the
/// measured moves of all units.
double PriceOfLostMove(const Fit& fit, std::size_t known);

/// Moves that the unit did not make, as the residuals show them: a step of each axis that was to
/// move.
std::vector<EventTerm> FindLostMoves(const Fit& fit, std::size_t unit, double price);

/// The unit's steps anew, all of them lost moves, if they explain its rows better than the model's
/// steps of the unit do, each at its price; nullopt otherwise. A lost move may be as long as a turn
/// of the rotor, or look like a lost command of one axis.
std::optional<std::vector<EventTerm>> LostMovesAnew(const Fit& fit, std::size_t unit, double price,
                                                    double price_of_other);

}  // namespace focalfleet::sim
