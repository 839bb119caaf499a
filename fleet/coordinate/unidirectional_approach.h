// Where units end that are to come to their targets from one side: past the target by the
// unidirectional approach, as far as nobody else stands or ends there. Greedy and in order: whoever
// finds no room for what it likes best takes what it likes next, or stays, and is tried again when
// its neighbours have chosen. For one that finds none at all, neighbours go aside that can. Cost: a
// few arm distances a unit and neighbour.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"

namespace focalfleet {

struct RunUp {
  std::optional<Pose> otherwise;  // where it ends without one; none: nobody knows, not looked at
  std::vector<Pose> wished;       // the best first; empty: it stays with `otherwise`
  std::vector<Pose> aside = {};   // where it would go to make room for another, and only then
};

/// One pose a unit: one of `wished`, of `aside`, or `otherwise`. Each new one is clear of all
/// others by the layout's clearance and `guard_mm`.
std::vector<std::optional<Pose>> ChooseRunUps(const Layout& layout,
                                              std::span<const UnitDrive> drives,
                                              std::span<const RunUp> units, double guard_mm);

}  // namespace focalfleet
