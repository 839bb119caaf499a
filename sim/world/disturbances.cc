#include "sim/world/disturbances.h"

#include "sim/world/world_core.h"

namespace focalfleet::sim {

void Disturbances::PowerCut(UnitId unit) { core_->PowerCut(core_->Row(unit)); }
void Disturbances::PowerOn(UnitId unit) { core_->PowerOn(core_->Row(unit)); }
void Disturbances::KillBus(BusId id) {
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().Kill(core_->now()); });
}
void Disturbances::ReviveBus(BusId id) {
  if (core_->Find(id) == nullptr) return;
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().Revive(core_->now()); });
}
void Disturbances::StickBus(BusId id) {
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().Stick(core_->now()); });
}
void Disturbances::ReleaseBus(BusId id) {
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().Release(core_->now()); });
}
void Disturbances::RestartHost(BusId id) {
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().RestartHost(core_->now()); });
}
void Disturbances::ThrowHostOff(BusId id) {
  core_->OnBus(id, [this](Bus* bus) { bus->disturb().ThrowHostOff(core_->now()); });
}
void Disturbances::Unplug(UnitId unit) {
  core_->OnBusOf(core_->Row(unit), [this](Bus* bus, std::uint32_t node) {
    bus->disturb().Unplug(node, core_->now());
  });
}
void Disturbances::Plug(UnitId unit) {
  core_->OnBusOf(core_->Row(unit),
                 [this](Bus* bus, std::uint32_t node) { bus->disturb().Plug(node, core_->now()); });
}
void Disturbances::Babble(UnitId unit, const std::optional<CanFrame>& frame) {
  core_->OnBusOf(core_->Row(unit), [&](Bus* bus, std::uint32_t node) {
    bus->disturb().Babble(node, frame, core_->now());
  });
}
void Disturbances::RaiseFault(UnitId unit, FaultCode code, Axis axis) {
  core_->RaiseFault(core_->Row(unit), {code, axis});
}
void Disturbances::SpoilFlash(UnitId unit, FlashDamage damage) {
  core_->unit(core_->Row(unit)).SpoilFlash(damage);
}
UnitFaults* Disturbances::faults(UnitId unit) {
  const auto row = core_->Find(unit);
  return row ? &core_->unit(*row).faults() : nullptr;
}
BusFaults* Disturbances::faults(BusId bus) {
  Wire* segment = core_->Find(bus);
  return segment != nullptr ? &segment->bus.faults() : nullptr;
}

}  // namespace focalfleet::sim
