#include <iterator>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

std::string_view NameOf(Owner owner) {
  switch (owner) {
    case Owner::kUnit:
      return "unit";
    case Owner::kRail:
      return "rail";
    case Owner::kBus:
      return "bus";
    case Owner::kPlate:
      return "plate";
    case Owner::kCamera:
      return "camera";
  }
  return "unit";
}

const std::vector<EffectKind>& Catalogue() {
  static const std::vector<EffectKind> all = [] {
    std::vector<EffectKind> kinds;
    for (auto part :
         {TravelEffects(), RotorEffects(), HistoryEffects(), GearEffects(), ArmEffects(),
          ThermalEffects(), PlateEffects(), CameraEffects(), ForeignEffects()})
      kinds.insert(kinds.end(), std::make_move_iterator(part.begin()),
                   std::make_move_iterator(part.end()));
    return kinds;
  }();
  return all;
}

const EffectKind* FindKind(std::string_view cause) {
  for (const EffectKind& kind : Catalogue())
    if (kind.cause == cause) return &kind;
  return nullptr;
}

}  // namespace focalfleet::hidden
