// The trace of a term is its effect on the fibres of its units.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

struct TermTrace {
  double rms_um = 0;               // of a move, in 2-D
  std::vector<double> square_um2;  // summed over the unit's moves. Shape: (units)
};
TermTrace TraceOf(const Fit& fit, const ModelTerm& term);

/// rms_um alone.
double SizeOf(const Fit& fit, const ModelTerm& term);

}  // namespace focalfleet::sim
