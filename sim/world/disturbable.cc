#include "sim/world/disturbable.h"

#include "sim/world/world_core.h"

namespace focalfleet::sim {

Disturbable::Disturbable() = default;
Disturbable::~Disturbable() = default;

void Disturbable::PowerCut(UnitId unit) { core_->PowerCut(core_->Row(unit)); }
void Disturbable::PowerOn(UnitId unit) { core_->PowerOn(core_->Row(unit)); }
void Disturbable::KillBus(BusId bus) {
  core_->OnBus(bus, [this](Bus* wire) { wire->Kill(core_->now()); });
}
void Disturbable::ReviveBus(BusId bus) {
  if (core_->Find(bus) == nullptr) return;
  core_->OnBus(bus, [this](Bus* wire) { wire->Revive(core_->now()); });
}
void Disturbable::StickBus(BusId bus) {
  core_->OnBus(bus, [this](Bus* wire) { wire->Stick(core_->now()); });
}
void Disturbable::ReleaseBus(BusId bus) {
  core_->OnBus(bus, [this](Bus* wire) { wire->Release(core_->now()); });
}
void Disturbable::RestartHost(BusId bus) {
  core_->OnBus(bus, [this](Bus* wire) { wire->RestartHost(core_->now()); });
}
void Disturbable::ThrowHostOff(BusId bus) {
  core_->OnBus(bus, [this](Bus* wire) { wire->ThrowHostOff(core_->now()); });
}
void Disturbable::Unplug(UnitId unit) {
  core_->OnBusOf(core_->Row(unit),
                 [this](Bus* wire, std::uint32_t node) { wire->Unplug(node, core_->now()); });
}
void Disturbable::Plug(UnitId unit) {
  core_->OnBusOf(core_->Row(unit),
                 [this](Bus* wire, std::uint32_t node) { wire->Plug(node, core_->now()); });
}
void Disturbable::Babble(UnitId unit, const std::optional<CanFrame>& frame) {
  core_->OnBusOf(core_->Row(unit),
                 [&](Bus* wire, std::uint32_t node) { wire->Babble(node, frame, core_->now()); });
}
void Disturbable::RaiseFault(UnitId unit, FaultCode code, Axis axis) {
  core_->RaiseFault(core_->Row(unit), {code, axis});
}
UnitFaults* Disturbable::faults(UnitId unit) {
  const auto row = core_->Find(unit);
  return row ? &core_->unit(*row).faults() : nullptr;
}
BusFaults* Disturbable::faults(BusId bus) {
  Wire* segment = core_->Find(bus);
  return segment != nullptr ? &segment->bus.faults() : nullptr;
}

}  // namespace focalfleet::sim
