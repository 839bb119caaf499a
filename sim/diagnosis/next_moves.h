// The moves to make next: those under which the rivals of an ambiguous cause would leave different
// traces, and those that excite what these moves left untested.
#pragma once

#include <string>
#include <vector>

#include "sim/diagnosis/diagnosis.h"

namespace focalfleet::sim {

/// One move of every unit, with the levers it needs; NaN: as it is usual.
struct ProposedMove {
  double theta_deg = 0;  // relative to the middle of the axis' range
  double phi_deg = 0;
  double drive_amplitude = 0;
  double delay_s = 0;
  double movers_share = 0;  // of the units on each rail
  bool home_first = false;
  std::string separates;  // which causes
};

/// At most 48 moves; none where nothing is confusable.
std::vector<ProposedMove> ProposeMoves(const Campaign& campaign, const Diagnosis& diagnosis);

}  // namespace focalfleet::sim
