#include "daemon/status/status_snapshot.h"

#include <algorithm>

#include "fleet/kinematics.h"

namespace focalfleet {

Witness WitnessOf(const UnitKnowledge& knowledge) {
  return std::min(knowledge[0].witness, knowledge[1].witness);
}

UnitStatusValue SnapshotUnit(const FleetView& view, PositionerIndex i) {
  const Unit& unit = view.layout->unit(i);
  const UnitView& seen = view.coordinator->unit(i);
  const UnitDrive& drive = view.coordinator->drives()[i.value];
  const UnitKnowledge knowledge = view.coordinator->KnowledgeAt(i, view.now);
  UnitStatusValue value;
  value.unit = unit.id;
  value.serial = seen.serial;
  value.bound_serial = seen.bound_serial;
  value.bus = unit.bus;
  value.node = unit.node;
  value.at = view.at;
  for (std::size_t a = 0; a < kAxisCount; ++a) {
    value.witness[a] = knowledge[a].witness;
    if (seen.target) value.target_deg[a] = AngleDeg((*seen.target)[a], unit.axis[a], drive.axis[a]);
    if (knowledge[a].witness == Witness::kUnknown) continue;
    value.low_deg[a] = AngleDeg(knowledge[a].low, unit.axis[a], drive.axis[a]);
    value.high_deg[a] = AngleDeg(knowledge[a].high, unit.axis[a], drive.axis[a]);
  }
  if (WitnessOf(knowledge) >= Witness::kPredicted) {
    const PointFp fibre = FibreAt(unit, drive, PlaceOf(knowledge));
    value.x_fp_mm = fibre.x_mm;
    value.y_fp_mm = fibre.y_mm;
  }
  if (seen.error_um) value.measured_error_um = *seen.error_um;
  value.move = seen.move;
  value.phase = seen.phase;
  value.reported_state = seen.reported_state;
  value.fault = seen.fault;
  value.outcome = seen.outcome;
  value.enabled = seen.enabled;
  return value;
}

std::optional<UnitOrientationValue> SnapshotOrientation(const FleetView& view, PositionerIndex i) {
  const UnitView& seen = view.coordinator->unit(i);
  if (!seen.carrier) return std::nullopt;
  UnitOrientationValue value{.unit = view.layout->unit(i).id,
                             .at = view.at,
                             .carrier = *seen.carrier,
                             .source = seen.source};
  if (WitnessOf(seen.knowledge) == Witness::kMeasured) {
    const PointFp fibre =
        FibreAt(view.layout->unit(i), view.coordinator->drives()[i.value], PlaceOf(seen.knowledge));
    value.x_fp_mm = fibre.x_mm;
    value.y_fp_mm = fibre.y_mm;
    value.covariance = seen.covariance;
  }
  return value;
}

BusStatusValue SnapshotBus(const FleetView& view, BusId bus) {
  return {.bus = bus, .at = view.at, .view = view.coordinator->bus(bus)};
}

FleetCounts CountFleet(const FleetView& view) {
  FleetCounts counts;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    counts.enabled += unit.enabled ? 1u : 0u;
    ++counts.by_phase[static_cast<std::size_t>(unit.phase)];
    ++counts.by_witness[static_cast<std::size_t>(WitnessOf(unit.knowledge))];
  }
  return counts;
}

double MakespanSoFar(const FleetView& view) {
  const ConfigurationView& c = view.coordinator->configuration();
  if (!view.coordinator->busy() || c.started == kNever) return c.makespan_s;
  return c.makespan_s + std::max(0.0, (view.now - c.started).seconds());
}

double HighestBusLoad(const FleetView& view) {
  double highest = 0;
  for (const BusId bus : view.layout->buses())
    highest = std::max(highest, view.coordinator->bus(bus).load_max);
  return highest;
}

}  // namespace focalfleet
