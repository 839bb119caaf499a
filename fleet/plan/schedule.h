// The schedule turns an order of single pieces into motions in parallel. The pieces come in an
// order in which they are clear one after the other. Each gets its time under one rule for two
// pieces of different units whose swept boxes are not clear of each other. The later in the order
// begins only after the earlier has ended, whatever the start skew and the clocks.
// docs/adr/0003-one-at-a-time-then-parallel.md proves that this is enough.
//
// With stages, all pieces of a stage begin after all of the stage before have ended, and no two of
// one stage meet. A unit that halts in it unseen blocks no other.
//
// Times are kept in timer counts (1 / 144 MHz), in which a vector is a whole number; segments begin
// on ticks.
#pragma once

#include <span>
#include <vector>

#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/power_ledger.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/sequential_planner.h"

namespace focalfleet {

/// Cuts long legs of one axis, so that followers wait for less. A unit's segments stay within
/// limits::kSegmentsPerAxis, and the order stays.
std::vector<Piece> CutPieces(std::span<const Piece> order, const Scene& scene);

/// Units whose pieces need more segments than one staged move holds; ascending.
std::vector<std::uint32_t> UnitsWithTooManyPieces(std::span<const Piece> order, std::size_t units);

/// The plan that runs the pieces under the rule. `ledger`: every piece waits until it fits in;
/// null: power has no limit. Pre: no unit has too many pieces. Errors: kRefused where the motion
/// would not end within the offsets that the wire can carry.
Result<Plan> Schedule(std::span<const Piece> order, const Scene& scene,
                      std::span<const UnitDrive> drives, const PlanOptions& options,
                      PowerLedger* ledger = nullptr);

}  // namespace focalfleet
