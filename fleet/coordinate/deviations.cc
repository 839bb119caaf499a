#include "fleet/coordinate/deviations.h"

#include <utility>

namespace focalfleet {
namespace {

bool IsWhere(const UnitKnowledge& knows, const UnitKnowledge& expected) {
  if (!IsPlace(knows) || !IsPlace(expected)) return knows == expected;
  return PlaceOf(knows) == PlaceOf(expected);
}

}  // namespace

std::optional<Deviation> DeviationOf(const Coordination& fleet, const Round& round,
                                     PositionerIndex i) {
  const UnitRecord& unit = fleet.units[i];
  const Part part = round.part(i);
  const bool as_planned =
      part == Part::kMoving && unit.view.phase == UnitPhase::kMoving && unit.motion.runs_freely;
  const bool to_start = part != Part::kMoving && part != Part::kNone;
  const auto is_over_at = [&](const UnitKnowledge& end) {
    return !round[i].ended_early && IsWhere(unit.view.knowledge, end);
  };
  if (const LateMove* const late = round.LateOf(i)) {
    if (as_planned || to_start || is_over_at(Exactly(Witness::kReported, late->move.to)))
      return Deviation{i, {}, *late};
  } else if (as_planned || is_over_at(round.running->PlannedEnd(i))) {
    return std::nullopt;
  }
  return Deviation{i, unit.view.knowledge, std::nullopt};
}

std::vector<Deviation> Deviations(const Coordination& fleet, const Round& round) {
  std::vector<Deviation> deviations;
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n)
    if (auto deviation = DeviationOf(fleet, round, {n}))
      deviations.push_back(std::move(*deviation));
  return deviations;
}

std::vector<Deviation> DeviationsNear(const Coordination& fleet, const Round& round,
                                      PositionerIndex i) {
  std::vector<Deviation> near;
  for (const PositionerIndex j : fleet.layout.neighbours(i))
    if (auto deviation = DeviationOf(fleet, round, j)) near.push_back(std::move(*deviation));
  return near;
}

}  // namespace focalfleet
