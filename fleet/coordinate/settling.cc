#include "fleet/coordinate/settling.h"

#include <variant>

#include "fleet/coordinate/watch.h"

namespace focalfleet {
namespace {

void StopSettling(const Coordination& fleet, PositionerIndex i, PositionerIndex in_its_way,
                  const std::string& what) {
  const RequestState& request = fleet.units[i].request;
  const bool asked = request.question && std::holds_alternative<Stop>(request.question->message);
  const bool is_stopped = request.reported_to_stop.ns != INT64_MIN &&
                          fleet.now() - request.reported_to_stop < fleet.config.silence_limit;
  if (!asked && !is_stopped) StopOne(fleet, i, fleet.units.NameOf(in_its_way) + " " + what);
}

}  // namespace

bool IsOfEarlierRun(const Coordination& fleet, PositionerIndex i) {
  const auto intent = fleet.ledger.intents.find(fleet.units[i].view.serial);
  return intent != fleet.ledger.intents.end() && !fleet.ledger.IsOfThisRun(intent->second);
}

void StopSettlingNear(const Coordination& fleet, PositionerIndex i, const std::string& what) {
  for (const PositionerIndex j : fleet.layout.neighbours(i))
    if (fleet.units[j].view.phase == UnitPhase::kSettling && IsOfEarlierRun(fleet, j))
      StopSettling(fleet, j, i, what);
}

void EndedEarly(const Coordination& fleet, PositionerIndex i) {
  fleet.units[i].ended_early = true;
  StopSettlingNear(fleet, i, "has ended early and may stand in its way");
}

void BeginSettling(const Coordination& fleet, PositionerIndex i) {
  fleet.units.SetPhase(i, UnitPhase::kSettling);
  if (!IsOfEarlierRun(fleet, i)) return;
  for (const PositionerIndex j : fleet.layout.neighbours(i))
    if (fleet.units[j].ended_early)
      return StopSettling(fleet, i, j, "has ended early and may stand in its way");
}

}  // namespace focalfleet
