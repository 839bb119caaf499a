// These functions report the true state of every unit, as truth.csv, and the true distances of the
// fibres from a file of targets. Targets given as angles become points by the description's
// geometry, which is what the request meant.
#pragma once

#include <string>
#include <string_view>

#include "fleet/targets.h"
#include "protocol/base/result.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

/// The true state of all units. Columns: unit_id, theta_true_deg, phi_true_deg, theta_vectors,
/// phi_vectors (as the unit counts), theta_true_vectors, phi_true_vectors, x_mm, y_mm, state,
/// moves_begun, last_move, powered, interrupted, begun_twice, began_s, clock_error.
/// began_s is the start of the unit's last motion, by the clock that daemon and simulation share;
/// empty: none in this run.
std::string TruthCsv(const sim::World& world);

struct TrueErrors {
  std::size_t units = 0;     // named by the targets and enabled
  std::size_t disabled = 0;  // named, but disabled: not counted
  double rms_um = 0;
  double max_um = 0;
  UnitId worst;
};
/// The distances from the targets.
/// Errors: kInvalid: a unit that is not in the fleet, with file:line.
Result<TrueErrors> CompareWithTargets(const sim::World& world, const Targets& targets);

}  // namespace focalfleet::simulator
