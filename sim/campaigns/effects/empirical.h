// Empirical terms are shapes that make no claim about physics. The first kind is a smooth curve
// over the ranks of a column, as five cosines. The second is a ripple of any order. Either acts on
// an angle or a direction of the plate. The screen (diagnosis/screen.h) uses them to find what no
// effect of the library explains, and the patch (diagnosis/patch.h) adds them to a model. They are
// no causes and not in the library.
//
// A rank belongs to its campaign: a hundredth of another night's rows are at another humidity. A
// curve for use with other campaigns has knots, the column's values at the ranks, and is read
// through them. Beyond the range of the knots the end value holds.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

inline constexpr std::size_t kEmpiricalCosines = 5;

/// The channel that a curve adds to, which is the `form` of its template. Plain channels are an
/// angle or a direction of the plate. Odd channels are an angle with the sign of the motion that
/// led there. Held channels keep that value until the axis moves again. The others are an angle by
/// the sine or cosine of itself. In x and y an amplitude of 1 is 0.1 mm.
enum EmpiricalChannel {
  kThetaAngle,
  kPhiAngle,
  kPlaceX,
  kPlaceY,
  kThetaOdd,
  kPhiOdd,
  kThetaHeld,
  kPhiHeld,
  kThetaSine,
  kThetaCosine,
  kPhiSine,
  kPhiCosine,
  kEmpiricalChannels
};

/// The effect whose columns are the cosines shape, shape + 1 .. shape + columns - 1 over the ranks
/// of `covariate`.
const Effect& EmpiricalCurve();
/// The effect whose columns are the sine and cosine of order `shape` of the axis' angle.
const Effect& EmpiricalRipple();
/// The empirical term of that name, or nullptr.
const Effect* FindEmpirical(std::string_view cause);

/// The channel that the template adds to, by name: "theta angle", "x" ... Pre: an empirical
/// template.
std::string_view ChannelOf(const Template& form);
/// The curve's channel of that name, or nullopt.
std::optional<EmpiricalChannel> ChannelNamed(std::string_view name);

/// The column's values at its ranks: every value, or 65 evenly over the ranks.
std::vector<RankKnot> KnotsOf(const FilledColumn& column);
/// Linear between the knots; the end's rank beyond them. Pre: not empty, values ascend.
double RankAt(std::span<const RankKnot> knots, double value);

/// The curve of all cosines over the look's column in the look's channel, with its knots.
/// Pre: facts have the column.
Template WholeCurve(const Template& look, const CampaignFacts& facts);

}  // namespace focalfleet::sim
