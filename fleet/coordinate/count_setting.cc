#include "fleet/coordinate/count_setting.h"

#include "fleet/coordinate/unit_knowledge.h"

namespace focalfleet {

void Locate(const Coordination& fleet, PositionerIndex i, const Pose& place) {
  UnitRecord& record = fleet.units[i];
  record.locating = {.place = place};
  if (!record.request.question) fleet.timers.Set(i, fleet.now());
}

void WriteCount(const Coordination& fleet, PositionerIndex i) {
  const Locating& locating = *fleet.units[i].locating;
  fleet.requests.Ask(
      i, ParameterWrite{locating.axis, Parameter::kPosition, locating.place[Index(locating.axis)]});
}

void OnCountWritten(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = fleet.units[i];
  Locating& locating = *record.locating;
  fleet.timers.Set(i, fleet.now());
  if (reply.axis != locating.axis) return;
  if (reply.answer != Answer::kOk) {
    record.locating.reset();
    fleet.ledger.alarms().Raise(AlarmName::kCountRefused, i, {},
                                fleet.units.NameOf(i) +
                                    " was found, but refuses to count from there: " +
                                    Name(reply.answer) + "; its place stays unknown");
    return;
  }
  locating.count[Index(locating.axis)] = reply.value;
  if (locating.axis == Axis::kTheta) {
    locating.axis = Axis::kPhi;
    return;
  }
  const Locating found = locating;
  record.locating.reset();
  for (const Axis axis : kAxes)
    record.view.offset[Index(axis)] = found.place[Index(axis)] - found.count[Index(axis)];
  Know(fleet, i, Exactly(Witness::kMeasured, found.place), Origin::kFound);
  fleet.units.Report(i, UnitEventKind::kReady);
}

}  // namespace focalfleet
