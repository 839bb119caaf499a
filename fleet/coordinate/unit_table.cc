#include "fleet/coordinate/unit_table.h"

#include <algorithm>
#include <string>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

/// The fault that the text of an alarm names; kNone: it names none.
FaultCode FaultIn(const std::string& text) {
  for (std::uint8_t code = 1; code < kFaultCodeCount; ++code) {
    const std::string name = Name(FaultCode{code});
    for (const char* before : {"in fault: ", "reports fault "})
      if (text.find(before + name) != std::string::npos) return FaultCode{code};
  }
  return FaultCode::kNone;
}

}  // namespace

UnitTable::UnitTable(const Layout& layout_in, std::vector<UnitDrive> drives_in,
                     const BusRates& rates, const StoredFleet& stored, const StepState& step)
    : layout(layout_in),
      drives(std::move(drives_in)),
      step_(step),
      units_(layout_in.size()),
      is_changed_(layout_in.size(), 0) {
  FOCALFLEET_CHECK(drives.size() == units_.size());
  for (const BusId id : layout.buses())
    buses.push_back({.id = id, .schedule = BusSchedule(rates), .view = {}, .units = {}});
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    const Unit& unit = layout.units()[n];
    units_[n].view.enabled = unit.enabled;
    if (!unit.enabled) units_[n].view.disabled_reason = "disabled in the units file";
    BusRecord* bus = FindBus(unit.bus);
    units_[n].bus = static_cast<std::size_t>(bus - buses.data());
    bus->units.push_back({n});
  }
  Take(stored);
}

void UnitTable::Take(const StoredFleet& stored) {
  for (const auto& row : stored.units) {
    const auto i = layout.Find(row.unit);
    if (!i) continue;  // a place that the present layout does not have keeps its rows
    UnitView& view = units_[i->value].view;
    view.bound_serial = row.serial;
    if (row.serial.value != 0) place_of[row.serial] = *i;
    if (!row.enabled) {
      view.enabled = false;
      view.disabled_reason = row.reason;
    }
  }
  for (const auto& row : stored.open_alarms) {
    const auto i = row.unit ? layout.Find(*row.unit) : std::nullopt;
    if (i && row.name == AlarmName::kUnitFault)
      units_[i->value].trouble.named_fault = FaultIn(row.text);
  }
  for (const auto& row : stored.parameters) {
    const auto place = place_of.find(row.serial);
    if (place == place_of.end()) continue;
    TakeParameter(row, &drives[place->second.value]);
  }
}

std::string UnitTable::NameOf(PositionerIndex i) const {
  return "unit " + std::to_string(layout.unit(i).id.value);
}

std::string UnitTable::TroubleOf(PositionerIndex i) const {
  const UnitView& view = units_[i.value].view;
  const std::string id = std::to_string(layout.unit(i).id.value);
  switch (view.phase) {
    case UnitPhase::kFault:
      if (!units_[i.value].trouble.not_kept.empty())
        return "is not moved, for the store refuses its rows (" + units_[i.value].trouble.not_kept +
               "): `focalfleet enable " + id + "` tries again";
      if (!units_[i.value].trouble.unfit.empty() && view.reported_state != UnitState::kFault)
        return "is not fit to move: " + units_[i.value].trouble.unfit;
      return "is in fault" +
             (view.fault == FaultCode::kNone ? "" : " (" + std::string(Name(view.fault)) + ")") +
             ": `focalfleet enable " + id + "` clears it";
    case UnitPhase::kForeign:
      return "has another serial number than the one that belongs there, " + WhoseSerial(i) +
             ": `focalfleet adopt " + id + "` accepts it";
    case UnitPhase::kSilent:
    case UnitPhase::kAbsent:
      if (units_[i.value].trouble.other_version)
        return "speaks protocol version " + std::to_string(*units_[i.value].trouble.other_version) +
               ", not " + std::to_string(kProtocolVersion) + " or " +
               std::to_string(kProtocolVersionWithSensors);
      if (units_[i.value].trouble.no_serial)
        return "answers with serial number 0: its memory is lost, or it was never programmed";
      return view.phase == UnitPhase::kAbsent ? "has never answered" : "does not answer any more";
    case UnitPhase::kIdentifying:
      return units_[i.value].reading.stored_by ? "waits until the store has its place"
                                               : "is still being read";
    case UnitPhase::kMoving:
    case UnitPhase::kHoming:
    case UnitPhase::kSettling:
      return "still moves";
    case UnitPhase::kStaging:
    case UnitPhase::kConfirming:
    case UnitPhase::kArming:
    case UnitPhase::kArmed:
      return "takes part in a configuration now";
    case UnitPhase::kReady:
      break;
  }
  return "is ready";
}

std::string UnitTable::WhyNoPlace(PositionerIndex i) const {
  const bool interval = units_[i.value].view.knowledge[0].witness == Witness::kInterval;
  return std::string("is ") + (interval ? "known only within an interval" : "not known") +
         ": `focalfleet home " + std::to_string(layout.unit(i).id.value) +
         "`, or `focalfleet measure` with a camera";
}

std::string UnitTable::WhoseSerial(PositionerIndex i) const {
  const auto place = place_of.find(units_[i.value].view.serial);
  return place == place_of.end() ? "which belongs to no unit"
                                 : "which belongs to " + NameOf(place->second);
}

BusRecord* UnitTable::FindBus(BusId id) {
  const auto it = std::lower_bound(buses.begin(), buses.end(), id,
                                   [](const BusRecord& bus, BusId want) { return bus.id < want; });
  return it != buses.end() && it->id == id ? &*it : nullptr;
}

void UnitTable::SetPhase(PositionerIndex i, UnitPhase phase) {
  UnitView& view = units_[i.value].view;
  FOCALFLEET_CHECK(IsAllowed(view.phase, phase));
  view.phase = phase;
  if (phase == UnitPhase::kMoving || phase == UnitPhase::kHoming)
    units_[i.value].motion.runs_freely = true;
  if (!MayWriteLater(phase)) RefuseWrites(i);
  Changed(i);
}

std::string UnitTable::WhyNoParameters(PositionerIndex i) const {
  return NameOf(i) + " takes parameters only at rest; its phase is " +
         Name(units_[i.value].view.phase);
}

void UnitTable::RefuseWrites(PositionerIndex i) {
  std::vector<ParameterOrder>& orders = units_[i.value].request.waiting_writes;
  for (const ParameterOrder& order : orders)
    step_.out->replies.push_back(
        {order.request, true, Error{ErrorCode::kRefused, WhyNoParameters(i)}, {}});
  orders.clear();
}

void UnitTable::Changed(PositionerIndex i) {
  if (is_changed_[i.value] != 0) return;
  is_changed_[i.value] = 1;
  step_.out->changed.push_back(i);
}

Pose UnitTable::PlaceAt(PositionerIndex i, const Pose& count) const {
  const Pose& offset = units_[i.value].view.offset;
  return {count[0] + offset[0], count[1] + offset[1]};
}

std::array<VectorRange, kAxisCount> UnitTable::RangesOf(PositionerIndex i) const {
  std::array<VectorRange, kAxisCount> ranges;
  for (const Axis axis : kAxes) {
    const VectorRange counts =
        RangeOf(layout.unit(i).axis[Index(axis)], drives[i.value].axis[Index(axis)]);
    const std::int32_t offset = units_[i.value].view.offset[Index(axis)];
    ranges[Index(axis)] = {counts.low + offset, counts.high + offset};
  }
  return ranges;
}

Pose UnitTable::NearestInReach(PositionerIndex i, const Pose& pose) const {
  const std::array<VectorRange, kAxisCount> ranges = RangesOf(i);
  const std::size_t theta = Index(Axis::kTheta);
  const std::int32_t turn =
      NearestVectors(360, layout.unit(i).axis[theta], drives[i.value].axis[theta]);
  Pose nearest = pose;
  for (const std::int32_t other : {pose[theta] - turn, pose[theta] + turn})
    if (!ranges[theta].contains(nearest[theta]) && ranges[theta].contains(other))
      nearest[theta] = other;
  for (const Axis axis : kAxes) {
    const auto& [low, high] = ranges[Index(axis)];
    nearest[Index(axis)] = std::clamp(nearest[Index(axis)], low, high);
  }
  return nearest;
}

void UnitTable::Report(PositionerIndex i, UnitEventKind kind, std::string reason) {
  events.push_back({i, kind, std::move(reason)});
}

void UnitTable::BeginStep() { std::fill(is_changed_.begin(), is_changed_.end(), std::uint8_t{0}); }

}  // namespace focalfleet
