#include "fleet/coordinate/unit_knowledge.h"

#include <utility>

namespace focalfleet {

void See(const Coordination& fleet, PositionerIndex i, const Pose& place,
         MeasurementSource source) {
  UnitView& view = fleet.units[i].view;
  const Pose believed = PlaceOf(view.knowledge);
  for (const Axis axis : kAxes)
    view.offset[Index(axis)] += place[Index(axis)] - believed[Index(axis)];
  Know(fleet, i, Exactly(Witness::kMeasured, place),
       source == MeasurementSource::kCamera ? Origin::kCamera : Origin::kSensors);
}

void Expect(const Coordination& fleet, PositionerIndex i, const Pose& offset) {
  UnitView& view = fleet.units[i].view;
  Pose place = PlaceOf(view.knowledge);
  for (const Axis axis : kAxes)
    place[Index(axis)] += offset[Index(axis)] - view.offset[Index(axis)];
  view.offset = offset;
  Know(fleet, i, Exactly(Witness::kReported, place), Origin::kCampaign);
}

void Know(const Coordination& fleet, PositionerIndex i, const UnitKnowledge& knowledge,
          Origin origin) {
  UnitRecord& record = fleet.units[i];
  record.view.knowledge = knowledge;
  fleet.units.Changed(i);
  if (IsPlace(knowledge)) fleet.ledger.alarms().End(AlarmName::kUnitPlaceLost, i, {});
  VectorRow row{
      .serial = record.view.serial,
      .knowledge = knowledge,
      .offset = record.view.offset,
      .subdivision = {fleet.drive(i).axis[0].subdivision, fleet.drive(i).axis[1].subdivision},
      .move = record.view.move,
      .origin = origin};
  fleet.ledger.vectors[row.serial] = row;
  fleet.ledger.Note(std::move(row));
}

}  // namespace focalfleet
