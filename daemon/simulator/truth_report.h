// What is true of every unit, as truth.csv, and how far the fibres truly are from where a targets
// file wants them. Targets given as angles are points by the description's geometry: that is what
// was asked for.
#pragma once

#include <string>
#include <string_view>

#include "fleet/targets.h"
#include "protocol/base/result.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

/// Columns: unit_id, theta_true_deg, phi_true_deg, theta_vectors, phi_vectors (what the unit
/// believes), theta_true_vectors, phi_true_vectors, x_mm, y_mm, state, moves_begun, last_move,
/// powered, interrupted, begun_twice, began_s (its last motion, by the clock that daemon and
/// simulation share; empty: none in this run), clock_error.
std::string TruthCsv(const sim::World& world);

struct TrueErrors {
  std::size_t units = 0;     // named by the targets and enabled
  std::size_t disabled = 0;  // named, but stands where it is: not counted
  double rms_um = 0;
  double max_um = 0;
  UnitId worst;
};
/// Errors: kInvalid: a unit that is not in the fleet, with file:line.
Result<TrueErrors> CompareWithTargets(const sim::World& world, const Targets& targets);

}  // namespace focalfleet::simulator
