#include "daemon/status/next_step.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/control/id_ranges.h"

namespace focalfleet {
namespace {

/// Ranges of units in the line; with more, a state chooses them.
constexpr std::size_t kRangesShown = 8;

/// Units that an operator can do something about, by unit_id.
struct Concerned {
  std::vector<std::uint32_t> fault;
  std::vector<std::uint32_t> foreign;
  std::vector<std::uint32_t> lost;    // ready, but of unknown place
  std::vector<std::uint32_t> silent;  // or never heard
};

Concerned ConcernedIn(const FleetView& view) {
  Concerned units;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    const std::uint32_t id = view.layout->unit({n}).id.value;
    if (!unit.enabled) continue;
    if (unit.phase == UnitPhase::kFault) units.fault.push_back(id);
    if (unit.phase == UnitPhase::kForeign) units.foreign.push_back(id);
    if (unit.phase == UnitPhase::kSilent || unit.phase == UnitPhase::kAbsent)
      units.silent.push_back(id);
    if (unit.phase == UnitPhase::kReady && !IsPlace(unit.knowledge)) units.lost.push_back(id);
  }
  return units;
}

/// `focalfleet VERB 7,9`, or `focalfleet VERB OTHERWISE` where the units are too many to name.
std::string Line(const std::string& verb, const std::vector<std::uint32_t>& units,
                 const std::string& otherwise) {
  const std::string ids = DescribeRanges(units, kRangesShown);
  return "focalfleet " + verb + " " + (ids.ends_with("...") ? otherwise : ids);
}

std::string Are(std::size_t count, const char* what) {
  return std::to_string(count) + (count == 1 ? " unit is " : " units are ") + what;
}

}  // namespace

std::string NextStep(const FleetView& view, const ShellFacts& facts) {
  if (facts.store_failing) return "focalfleet alarms  (the store cannot be written)";
  if (view.coordinator->busy()) return "focalfleet wait";
  for (const BusId bus : view.layout->buses())
    if (view.coordinator->bus(bus).link != LinkState::kUp &&
        view.coordinator->bus(bus).link != LinkState::kPassive)
      return "focalfleet alarms  (bus " + std::to_string(bus.value) + " is " +
             Name(view.coordinator->bus(bus).link) + ")";
  const Concerned units = ConcernedIn(view);
  if (!units.fault.empty())
    return Line("enable", units.fault, "--state fault") + "  (" +
           Are(units.fault.size(), "in fault") + "; look at its cause first)";
  if (!units.foreign.empty())
    return Line("unit", units.foreign, "--state foreign") + "  (" +
           Are(units.foreign.size(), "other hardware than before: adopt what was replaced") + ")";
  if (!units.lost.empty()) {
    const std::string why = "  (" + Are(units.lost.size(), "of unknown place") + ")";
    if (view.coordinator->config().has_camera) return "focalfleet measure --wait" + why;
    return Line("home", units.lost, "--not-known") + " --wait" + why;
  }
  if (!units.silent.empty())
    return Line("unit", units.silent, "--state silent --state absent") + "  (" +
           Are(units.silent.size(), "not heard") + ")";
  if (facts.alarms.open > 0) return "focalfleet alarms";
  return "focalfleet apply FILE --dry-run";
}

}  // namespace focalfleet
