// All units at once on a plate where every way crosses many others, and a plan that ends sooner
// than one that is there already.
//
// The idea (large neighbourhood search, Li et al., MAPF-LNS 2021 and MAPF-LNS2 2022). Every unit
// has a way that ends in time, whether or not it meets others. A few units around one conflict are
// taken out and planned anew, one after the other, each so that it meets the others as little as
// possible (soft_search.h); two that are hooked into each other are planned together
// (joint_search.h, pair_search.h). Units that the new ways meet are planned anew, too. The change
// stays if there are no more conflicts than before. Once there are none the plan is complete, and
// the time is cut: units that end too late are planned anew within less time, and what they meet is
// repaired in the same manner. Where that finds no end all move as before. The plan is therefore
// never worse, and may be taken at any time.
//
// The work is counted, not timed: the same request and budget give the same bits on every machine.
#pragma once

#include <cstdint>
#include <limits>

#include "fleet/plan/local_search.h"

namespace focalfleet {

struct DenseSearchOptions {
  double within = 1.25;  // times request.within_s: the time of the first plan
  /// CPU time until all are clear of each other, counted as work. Units: s of a usual machine.
  double complete_cpu_s = std::numeric_limits<double>::infinity();
  /// CPU time for an earlier end, counted as work. Units: s of a usual machine.
  double improve_cpu_s = 0;
};

/// A motion for every unit of the request, as SearchLocally. Ways of the request's `begin_with` are
/// kept where they lead to the target. Cost: O(n) for bounded neighbourhoods, and the budget.
LocalSearchResult SearchDense(const LocalSearchRequest& request, const DenseSearchOptions& options);

}  // namespace focalfleet
