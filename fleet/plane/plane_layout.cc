#include "fleet/plane/plane_layout.h"

#include <algorithm>
#include <bit>
#include <string>
#include <unordered_map>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {

Result<PlaneLayout> PlaneLayout::Create(Layout layout, std::vector<std::vector<BusId>> buses) {
  if (buses.empty() || buses.size() > limits::kSectors)
    return Fail(ErrorCode::kInvalid,
                "a plane has 1 to " + std::to_string(limits::kSectors) + " sectors");
  std::unordered_map<BusId, std::uint32_t> owner;
  for (std::uint32_t sector = 0; sector < buses.size(); ++sector)
    for (const BusId bus : buses[sector]) {
      const std::string name = "bus " + std::to_string(bus.value);
      if (!std::ranges::binary_search(layout.buses(), bus))
        return Fail(ErrorCode::kInvalid,
                    name + " of sector " + std::to_string(sector) + " is not in the units file");
      if (!owner.emplace(bus, sector).second)
        return Fail(ErrorCode::kInvalid, name + " is in two sectors");
    }
  PlaneLayout plane(std::move(layout));
  plane.own_.resize(buses.size());
  for (std::uint32_t n = 0; n < plane.layout_.size(); ++n) {
    const BusId bus = plane.layout_.units()[n].bus;
    const auto found = owner.find(bus);
    if (found == owner.end())
      return Fail(ErrorCode::kInvalid, "bus " + std::to_string(bus.value) + " is in no sector");
    std::vector<PositionerIndex>& own = plane.own_[found->second];
    plane.sector_.push_back(found->second);
    plane.local_.push_back({static_cast<std::uint32_t>(own.size())});
    own.push_back({n});
  }
  for (std::uint32_t sector = 0; sector < buses.size(); ++sector)
    if (plane.own_[sector].empty())
      return Fail(ErrorCode::kInvalid, "sector " + std::to_string(sector) + " has no unit");
  plane.FindBorders();
  return plane;
}

void PlaneLayout::FindBorders() {
  const auto add = [](std::uint32_t sector, std::vector<std::uint32_t>* list) {
    const auto at = std::ranges::lower_bound(*list, sector);
    if (at == list->end() || *at != sector) list->insert(at, sector);
  };
  beyond_.resize(layout_.size());
  neighbours_.resize(own_.size());
  for (std::uint32_t n = 0; n < layout_.size(); ++n)
    for (const PositionerIndex other : layout_.neighbours({n})) {
      if (sector_[other.value] == sector_[n]) continue;
      add(sector_[other.value], &beyond_[n]);
      add(sector_[other.value], &neighbours_[sector_[n]]);
    }
}

std::uint64_t DigestOf(const Layout& layout) {
  std::uint64_t digest = 0xcbf29ce484222325u;
  const auto add = [&digest](std::uint64_t word) { digest = (digest ^ word) * 0x100000001b3u; };
  for (const Unit& unit : layout.units()) {
    for (const std::uint64_t word : {std::uint64_t{unit.id.value}, std::uint64_t{unit.bus.value},
                                     std::uint64_t{unit.node.value}})
      add(word);
    for (const double number : {unit.base_fp.x_mm, unit.base_fp.y_mm, unit.arm_half_width_mm})
      add(std::bit_cast<std::uint64_t>(number));
    for (const AxisGeometry& axis : unit.axis)
      for (const double number :
           {axis.arm_mm, axis.zero_deg, axis.gear, axis.min_deg, axis.max_deg})
        add(std::bit_cast<std::uint64_t>(number));
  }
  return digest;
}

}  // namespace focalfleet
