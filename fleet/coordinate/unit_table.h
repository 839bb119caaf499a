// The unit table holds the records of all units and buses. Questions about a unit are answered
// here: its name, why it cannot be moved, the places that it can reach. A phase changes here alone,
// by the table of unit_phase.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "fleet/coordinate/step_state.h"
#include "fleet/coordinate/unit_event.h"
#include "fleet/coordinate/unit_phase.h"
#include "fleet/coordinate/unit_record.h"
#include "fleet/drive.h"
#include "fleet/kinematics.h"
#include "fleet/layout.h"
#include "fleet/records.h"

namespace focalfleet {

class UnitTable {
 public:
  /// `layout` and `step` outlive the table. Every unit takes from `stored` what is bound to its
  /// place: serial number, enabled or not, parameters. Pre: one drive for each unit.
  UnitTable(const Layout& layout, std::vector<UnitDrive> drives, const BusRates& rates,
            const StoredFleet& stored, const StepState& step);

  [[nodiscard]] UnitRecord& operator[](PositionerIndex i) { return units_[i.value]; }
  [[nodiscard]] const UnitRecord& operator[](PositionerIndex i) const { return units_[i.value]; }
  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(units_.size()); }
  [[nodiscard]] const std::vector<UnitRecord>& all() const { return units_; }
  [[nodiscard]] BusRecord& bus_of(PositionerIndex i) { return buses[units_[i.value].bus]; }
  /// Null: no such bus.
  [[nodiscard]] BusRecord* FindBus(BusId id);

  [[nodiscard]] std::string NameOf(PositionerIndex i) const;  // "unit 12"
  /// Why the unit cannot be moved, and what helps, to follow its name or "it":
  /// "is in fault (driver): `focalfleet enable 9` clears it". Pre: it is not kReady.
  [[nodiscard]] std::string TroubleOf(PositionerIndex i) const;
  /// The knowledge in place of a place, and what helps, to follow "its place": "is not known:
  /// `focalfleet home 9` ...". Pre: it is at no known place.
  [[nodiscard]] std::string WhyNoPlace(PositionerIndex i) const;
  /// The place to which the serial number belongs that answers here: "which belongs to unit 8", or
  /// "which belongs to no unit".
  [[nodiscard]] std::string WhoseSerial(PositionerIndex i) const;

  /// Why the unit takes no parameters, as a sentence.
  [[nodiscard]] std::string WhyNoParameters(PositionerIndex i) const;
  /// Refuses the parameters that wait to be written.
  void RefuseWrites(PositionerIndex i);

  /// Refuses waiting parameters where the unit rests no more. Pre: IsAllowed.
  void SetPhase(PositionerIndex i, UnitPhase phase);
  /// Adds the unit to Effects::changed, once a step.
  void Changed(PositionerIndex i);
  void Report(PositionerIndex i, UnitEventKind kind, std::string reason = {});

  /// The place of a unit whose own count of vectors is `count`.
  [[nodiscard]] Pose PlaceAt(PositionerIndex i, const Pose& count) const;
  /// Places that its own counts can have: the unit holds itself to its range by the count.
  [[nodiscard]] std::array<VectorRange, kAxisCount> RangesOf(PositionerIndex i) const;
  /// The pose itself where it is within these; else with theta another whole turn on, where that
  /// is; else as near as its axes get.
  [[nodiscard]] Pose NearestInReach(PositionerIndex i, const Pose& pose) const;

  void BeginStep();

  const Layout& layout;
  std::vector<UnitDrive> drives;
  std::vector<BusRecord> buses;
  std::vector<UnitEvent> events;  // since the executor took them last
  std::unordered_map<SerialNumber, PositionerIndex> place_of;
  std::vector<PositionerIndex> awaiting_store;  // may hold a unit that does not any more, or twice

 private:
  void Take(const StoredFleet& stored);

  const StepState& step_;
  std::vector<UnitRecord> units_;
  std::vector<std::uint8_t> is_changed_;  // by unit, in this step
};

}  // namespace focalfleet
