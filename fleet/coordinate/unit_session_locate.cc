// UnitSessions, a unit of unknown place that was found: its own count is set to where it stands.
//
// The unit takes the count nearest to the written one that shows the vector now applied, because
// rotor and field agree at rest (docs/protocol.md, Power). So only whole motor turns change, and
// what is left, at most half a motor turn, is the offset of its place from its count. An
// interrupted unit takes moves again once both counts are written.
#include "fleet/coordinate/unit_session.h"

namespace focalfleet {

void UnitSessions::Locate(PositionerIndex i, const Pose& place) {
  UnitRecord& record = core_.unit(i);
  record.locating = {.place = place};
  if (!record.question) core_.SetDue(i, core_.now);
}

void UnitSessions::WriteCount(PositionerIndex i) {
  const UnitRecord::Locating& locating = *core_.unit(i).locating;
  core_.Ask(
      i, ParameterWrite{locating.axis, Parameter::kPosition, locating.place[Index(locating.axis)]});
}

void UnitSessions::OnCountWritten(PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = core_.unit(i);
  UnitRecord::Locating& locating = *record.locating;
  core_.SetDue(i, core_.now);
  if (reply.axis != locating.axis) return;
  if (reply.answer != Answer::kOk) {
    record.locating.reset();
    core_.Raise(Severity::kWarning, i, {},
                core_.NameOf(i) + " was found, but refuses to count from there: " +
                    Name(reply.answer) + "; its place stays unknown");
    return;
  }
  locating.count[Index(locating.axis)] = reply.value;
  if (locating.axis == Axis::kTheta) {
    locating.axis = Axis::kPhi;
    return;
  }
  const UnitRecord::Locating found = locating;
  record.locating.reset();
  for (const Axis axis : kAxes)
    record.view.offset[Index(axis)] = found.place[Index(axis)] - found.count[Index(axis)];
  core_.Know(i, Exactly(Witness::kMeasured, found.place), Origin::kFound);
  core_.Tell(i, UnitEventKind::kReady);
}

}  // namespace focalfleet
