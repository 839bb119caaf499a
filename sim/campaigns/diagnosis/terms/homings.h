// Homings may leave different zeros. Here are the scatter of these zeros and the cause that names
// it. fit.h frees the zeros; multi_start.h decides whether they are worth it.
#pragma once

#include <cmath>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// Rms over the moves, and its effect at the fibre.
struct HomingScatter {
  double rms_deg[2] = {0, 0};
  double um[2] = {0, 0};
  [[nodiscard]] double both_um() const { return std::hypot(um[0], um[1]); }
};
/// Pre: zeros are free.
HomingScatter ScatterOfHomings(const Fit& fit);
CauseFound HomingCause(const Fit& fit);

}  // namespace focalfleet::sim
