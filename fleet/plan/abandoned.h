// Whether anybody still wants the plan that is being made. A search asks now and then, and finds
// nothing any more once it is told no; a plan that was not abandoned is the same whether anybody
// was asked or not. Whoever calls knows why: the core has no clock and no thread.
#pragma once

#include <functional>

namespace focalfleet {

/// True: give up. Empty: never. Asked some 100,000 times for a plan, so it must cost little.
using Abandoned = std::function<bool()>;

inline bool IsAbandoned(const Abandoned& abandoned) { return abandoned && abandoned(); }

}  // namespace focalfleet
