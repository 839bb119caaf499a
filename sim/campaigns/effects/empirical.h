// Empirical terms: shapes that make no claim about physics. A smooth curve over the ranks of a
// column, as five cosines, or a ripple of any order, on an angle or a direction of the plate. The
// screen looks with them at what no effect of the library explains (diagnosis/screen.h), and the
// patch puts them into a model (diagnosis/patch.h). They are no causes and not in the library.
//
// A rank is of its campaign: a hundredth of another night's rows are at another humidity. A curve
// that is to hold beside its campaign has knots, the column's values at the ranks, and is read
// through them; beyond the range it was seen in, the end value holds.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

inline constexpr std::size_t kEmpiricalCosines = 5;

/// What a curve adds to: an angle, a direction of the plate, an angle with the sign of the motion
/// that led there; the same as it was when the axis moved, until it moves again; an angle by the
/// sine or cosine of itself. The `form` of its template. In x and y an amplitude of 1 is 0.1 mm.
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

/// Cosines shape, shape + 1 .. shape + columns - 1 over the ranks of `covariate`.
const Effect& EmpiricalCurve();
/// Sine and cosine of order `shape` of the axis' angle.
const Effect& EmpiricalRipple();
/// nullptr: no empirical term is called that.
const Effect* FindEmpirical(std::string_view cause);

/// Where the template acts: "theta angle", "x" ... Pre: it is an empirical one.
std::string_view ChannelOf(const Template& form);
/// The curve's channel of that name; none: there is none.
std::optional<EmpiricalChannel> ChannelNamed(std::string_view name);

/// The column's values at its ranks: every value, or 65 evenly over the ranks.
std::vector<RankKnot> KnotsOf(const FilledColumn& column);
/// Straight between the knots; the end's beyond them. Pre: not empty, values ascend.
double RankAt(std::span<const RankKnot> knots, double value);

/// The curve of all cosines in the look's channel over the look's column, with its knots.
/// Pre: facts have the column.
Template WholeCurve(const Template& look, const CampaignFacts& facts);

}  // namespace focalfleet::sim
