#include "fleet/coordinate/settling.h"

#include <algorithm>
#include <variant>

#include "fleet/coordinate/stall_detection.h"
#include "fleet/coordinate/watch.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

constexpr const char* kEndedEarly = "has ended early and may stand in its way";
constexpr const char* kLost = "does not answer and may stand in its way";

void StopSettling(const Coordination& fleet, PositionerIndex i, PositionerIndex in_its_way,
                  const std::string& what) {
  const auto& question = fleet.units[i].request.question;
  if (question && std::holds_alternative<Stop>(question->message)) return;
  StopOne(fleet, i, fleet.units.NameOf(in_its_way) + " " + what);
}

bool IsLost(const UnitRecord& unit) {
  return unit.view.phase == kSilent || (unit.view.phase == kAbsent && unit.asked_once);
}

}  // namespace

bool HasEarlierMove(const Coordination& fleet, PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  const auto intent =
      fleet.ledger.intents.find(view.serial.value != 0 ? view.serial : view.bound_serial);
  return intent != fleet.ledger.intents.end() && !fleet.ledger.IsOfThisRun(intent->second);
}

void StopSettlingNear(const Coordination& fleet, PositionerIndex i, const std::string& what) {
  for (const PositionerIndex j : fleet.layout.neighbours(i)) {
    const UnitPhase phase = fleet.units[j].view.phase;
    // A unit that is not heard may hear.
    if ((phase == kSettling || phase == kSilent) && HasEarlierMove(fleet, j))
      StopSettling(fleet, j, i, what);
  }
}

void EndedEarly(const Coordination& fleet, PositionerIndex i) {
  fleet.units[i].motion.ended_early = true;
  StopSettlingNear(fleet, i, kEndedEarly);
}

void LostOnItsWay(const Coordination& fleet, PositionerIndex i) {
  if (HasEarlierMove(fleet, i)) StopSettlingNear(fleet, i, kLost);
}

void BeginSettling(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& unit = fleet.units[i];
  fleet.units.SetPhase(i, kSettling);
  unit.next_poll = std::min(unit.next_poll, fleet.now() + StallDetectionOf(fleet.config).poll);
  fleet.timers.Set(i, unit.next_poll);
  if (!HasEarlierMove(fleet, i)) return;
  for (const PositionerIndex j : fleet.layout.neighbours(i)) {
    const bool ended_early = fleet.units[j].motion.ended_early;
    if (!ended_early && !(IsLost(fleet.units[j]) && HasEarlierMove(fleet, j))) continue;
    return StopSettling(fleet, i, j, ended_early ? kEndedEarly : kLost);
  }
}

}  // namespace focalfleet
