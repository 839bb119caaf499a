// A second physics for the same causes. The first integrates mechanisms; this one has laws as
// measurements of such parts are usually described: power laws, logarithms, polynomials, plays with
// a spread of gaps. Names, owners and sizes are the same, so that a diagnosis which knows one
// physics too well is found out by the other.
#pragma once

#include <string_view>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

using ApplyEffect = void (*)(const Scene&, const Effect&, std::size_t unit, Track*);

/// The cause's law in this physics; nullptr where both have the same.
ApplyEffect CurveOf(std::string_view cause);

/// The part of CurveOf for parts with memory.
ApplyEffect HistoryCurveOf(std::string_view cause);

}  // namespace focalfleet::hidden
