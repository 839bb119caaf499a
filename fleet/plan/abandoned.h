// `Abandoned` lets the caller give up a plan that is being made. A search asks it now and then, and
// finds nothing more once the answer is true. A plan that was not abandoned is the same whether the
// search asked or not. The reason stays with the caller: the core has no clock and no thread.
#pragma once

#include <functional>

namespace focalfleet {

/// True: give up. Empty: never. A plan asks some 100,000 times, so the call must cost little.
using Abandoned = std::function<bool()>;

inline bool IsAbandoned(const Abandoned& abandoned) { return abandoned && abandoned(); }

}  // namespace focalfleet
