#include "daemon/verbs/unit_selection.h"

#include <algorithm>
#include <cstdint>
#include <string>

namespace focalfleet {
namespace {

/// For each unit, whether all conditions so far hold.
using Chosen = std::vector<std::uint8_t>;

Status KeepNumbers(const Json& args, const Layout& layout, Chosen* chosen) {
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "unit_ids"));
  Chosen named(layout.size(), 0);
  for (const std::uint32_t id : ids) {
    const auto i = layout.Find(UnitId{id});
    if (!i) return Fail(ErrorCode::kInvalid, "there is no unit " + std::to_string(id));
    named[i->value] = 1;
  }
  for (std::size_t n = 0; n < named.size(); ++n) (*chosen)[n] &= named[n];
  return {};
}

Status KeepBuses(const Json& args, const Layout& layout, Chosen* chosen) {
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "bus_ids"));
  for (const std::uint32_t id : ids)
    if (std::ranges::find(layout.buses(), BusId{id}) == layout.buses().end())
      return Fail(ErrorCode::kInvalid, "there is no bus " + std::to_string(id));
  for (std::uint32_t n = 0; n < layout.size(); ++n)
    if (std::ranges::find(ids, layout.unit({n}).bus.value) == ids.end()) (*chosen)[n] = 0;
  return {};
}

bool IsState(const std::string& state) {
  if (state == "disabled" || state == "unknown") return true;
  for (std::size_t phase = 0; phase < kUnitPhaseCount; ++phase)
    if (state == Name(static_cast<UnitPhase>(phase))) return true;
  return false;
}

bool IsIn(const UnitView& unit, const std::string& state) {
  if (state == "disabled") return !unit.enabled;
  if (state == "unknown") return !IsPlace(unit.knowledge);
  return state == Name(unit.phase);
}

Status KeepStates(const Json& args, const FleetView& view, Chosen* chosen) {
  const Json& list = args["states"];
  if (!list.is_array() || list.empty())
    return Fail(ErrorCode::kInvalid, "states must be a list of texts");
  Chosen in_any(chosen->size(), 0);
  for (const Json& entry : list) {
    const std::string state = entry.is_string() ? entry.get<std::string>() : "";
    if (!IsState(state))
      return Fail(ErrorCode::kInvalid,
                  "there is no state '" + state +
                      "'; states are the phases of `focalfleet status`, disabled and unknown");
    for (std::uint32_t n = 0; n < in_any.size(); ++n)
      if (IsIn(view.coordinator->unit({n}), state)) in_any[n] = 1;
  }
  for (std::size_t n = 0; n < in_any.size(); ++n) (*chosen)[n] &= in_any[n];
  return {};
}

}  // namespace

Result<std::vector<PositionerIndex>> SelectUnits(const Json& args, const FleetView& view) {
  Chosen chosen(view.layout->size(), 1);
  const bool by_number = args.contains("unit_ids");
  const bool by_bus = args.contains("bus_ids");
  const bool by_state = args.contains("states");
  if (!by_number && !by_bus && !by_state) return Fail(ErrorCode::kInvalid, "no unit named");
  if (by_number) FOCALFLEET_TRY(KeepNumbers(args, *view.layout, &chosen));
  if (by_bus) FOCALFLEET_TRY(KeepBuses(args, *view.layout, &chosen));
  if (by_state) FOCALFLEET_TRY(KeepStates(args, view, &chosen));
  std::vector<PositionerIndex> units;
  for (std::uint32_t n = 0; n < chosen.size(); ++n)
    if (chosen[n] != 0) units.push_back({n});
  if (units.empty()) return Fail(ErrorCode::kRefused, "no unit is so");
  return units;
}

}  // namespace focalfleet
