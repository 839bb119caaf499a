#include "daemon/plane/plane_refusal.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

namespace focalfleet {
namespace {

constexpr std::size_t kNamedMost = 6;

std::vector<std::uint32_t> UnitsIn(const Json& args) {
  if (const auto ids = UnsignedListArgument(args, "unit_ids")) return {ids->begin(), ids->end()};
  if (const auto id = UnsignedArgument(args, "unit_id"); id && *id <= UINT32_MAX)
    return {static_cast<std::uint32_t>(*id)};
  return {};
}

std::string DoorOf(const PlaneInstant& plane, std::uint32_t sector) {
  const auto& report = plane.coordinator->sectors()[sector].report;
  const std::string name = NameOfSector(sector);
  if (!report || report->door.empty()) return name + " (not heard yet)";
  return name + " (" + report->door + ")";
}

/// The sectors of the units, or all.
std::string DoorsOf(const PlaneInstant& plane, const std::vector<std::uint32_t>& units) {
  std::set<std::uint32_t> sectors;
  for (const std::uint32_t unit : units)
    if (const auto i = plane.plane->layout().Find(UnitId{unit}))
      sectors.insert(plane.plane->SectorOf(*i));
  if (units.empty())
    for (std::uint32_t n = 0; n < plane.plane->sectors(); ++n) sectors.insert(n);
  std::string text;
  std::size_t named = 0;
  for (const std::uint32_t sector : sectors) {
    if (named++ == kNamedMost) {
      text += " and " + std::to_string(sectors.size() - kNamedMost) + " more";
      break;
    }
    text += (text.empty() ? "" : ", ") + DoorOf(plane, sector);
  }
  return text;
}

}  // namespace

Error RefusalOf(const PlaneInstant& plane, const ControlRequest& request) {
  const std::string& verb = request.verb;
  const std::vector<std::uint32_t> units = UnitsIn(request.args);
  for (const std::uint32_t unit : units)
    if (!plane.plane->layout().Find(UnitId{unit}))
      return {ErrorCode::kInvalid, "there is no unit " + std::to_string(unit) + " in the plane"};
  const std::string doors = DoorsOf(plane, units);
  if (verb == "history")
    return {ErrorCode::kRefused,
            "a plane's coordinator keeps the configuration under way alone; each sector's daemon "
            "has the history of its units: " +
                doors};
  return {ErrorCode::kRefused,
          verb + " is answered by the daemon that has the units, on its own socket: " + doors};
}

}  // namespace focalfleet
