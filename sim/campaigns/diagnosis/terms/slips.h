// Slips are steps of an axis by whole turns of its rotor, against the motion, that stay until the
// unit is homed. Each is a hypothesis with a fixed size, so that its likelihood ratio needs no fit
// of an amplitude: chance reaches a ratio of e^L with probability e^-L at most. The first slip of a
// campaign is taken where the ratio is larger than the number of slips that there could have been,
// by the family-wise rate. Where some are known, others are as likely as they are frequent: a slip
// is taken where its probability is 0.9. The narrowest window of rows that shows a slip tells it,
// with the unit's geometry free in the window.
// Source: Ville's inequality, as in Royall, Statistical Evidence, chapter 1.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// Turns that a rotor may lose at once, at most.
inline constexpr int kSlipTurnsMax = 20;

/// The log likelihood ratio that a slip has to exceed. Shape: (axes, turns less one).
using SlipPrices = std::array<std::array<double, kSlipTurnsMax>, 2>;

/// The prices where no slip is known, so that any unit of the campaign has one by chance in this
/// share of campaigns.
SlipPrices PricesOfFirst(const Fit& fit, double family_wise);

/// The prices in a unit where these slips of the campaign are known, of all units. The share of
/// units that slip, and how often, in which axis and by how many turns they do, are as counted. A
/// unit that has slipped may do so again; another one has not done so, as often as it could have.
SlipPrices PricesByCount(const Fit& fit, std::span<const EventTerm> known, std::size_t unit);

/// The unit's slips, as the residuals show them. `noisy`: the unit may look noisy because its slips
/// are not known.
std::vector<EventTerm> FindSlips(const Fit& fit, std::size_t unit, const SlipPrices& prices,
                                 bool noisy);

/// The unit's steps anew, all of them slips, if they explain its rows better than the model's steps
/// of the unit do, each at its price; nullopt otherwise. `price_of_other`: of a step that is no
/// slip.
std::optional<std::vector<EventTerm>> SlipsAnew(const Fit& fit, std::size_t unit,
                                                const SlipPrices& prices, double price_of_other);

/// Whether the step is one of whole turns.
bool IsSlip(const Fit& fit, const EventTerm& event);

/// ln of the likelihood ratio of each step of the model, beside all other terms. Shape: (events).
std::vector<double> LogLikelihoodOfEvents(const Fit& fit);

}  // namespace focalfleet::sim
