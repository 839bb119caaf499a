#include "sim/world/world.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <unordered_set>

#include "protocol/base/limits.h"
#include "sim/world/world_core.h"

namespace focalfleet::sim {
namespace {

Controller ControllerOf(const BusNode& node) {
  const ErrorCounters& errors = node.errors;
  return {node.state(), errors.warns(), errors.transmit(), errors.receive()};
}

Status Complain(const UnitDescription& unit, const std::string& what) {
  return Fail(ErrorCode::kInvalid, "unit " + std::to_string(unit.id.value) + ": " + what);
}

Status ValidateUnit(const UnitDescription& unit, const FactoryDrive& drive) {
  if (unit.sensors > limits::kSensorsPerUnit) return Complain(unit, "has too many sensors");
  if (unit.sensors > 0 && !(unit.fibre_carrier_mm > 0 && std::isfinite(unit.fibre_carrier_mm)))
    return Complain(unit, "has sensors at its joint, and no fibre carrier on it");
  if (unit.node == kBroadcastNode) return Complain(unit, "node 255 is the broadcast address");
  // A larger error would be a clock that stands still or runs back.
  constexpr double kClockErrorMax = 0.5;
  if (!(std::abs(unit.clock_error.value_or(0)) <= kClockErrorMax))
    return Complain(unit, "has a clock that is off by more than a half");
  for (const Axis which : kAxes) {
    const AxisDescription& axis = unit.axis[Index(which)];
    const std::string name = Name(which);
    const double numbers[] = {
        axis.arm_mm,  axis.zero_deg,  axis.gear,      axis.min_deg,
        axis.max_deg, unit.base_x_mm, unit.base_y_mm, axis.angle_deg.value_or(0)};
    for (const double number : numbers)
      if (!std::isfinite(number)) return Complain(unit, name + " has a number that is not finite");
    if (axis.gear <= 0) return Complain(unit, name + "_gear is not positive");
    if (axis.min_deg >= axis.max_deg) return Complain(unit, name + "_min_deg is not below its max");
    const double vectors = std::max(std::abs(axis.min_deg), std::abs(axis.max_deg)) *
                           drive.subdivision * axis.gear / 360;
    if (vectors > limits::kPositionMax / 2)
      return Complain(unit, name + " has more vectors than the wire can carry");
  }
  return {};
}

Status ValidateFaults(const WorldConfig& config) {
  const auto complain = [](const PlannedFault& fault, const std::string& what) {
    return Fail(ErrorCode::kInvalid,
                "planned fault '" + std::string(InfoOf(fault.kind).name) + "': " + what);
  };
  for (const PlannedFault& fault : config.faults) {
    const FaultKindInfo& info = InfoOf(fault.kind);
    const bool known = std::ranges::any_of(config.units, [&](const UnitDescription& unit) {
      return info.of_unit ? unit.id == fault.unit : unit.bus == fault.bus;
    });
    if (!known)
      return complain(fault, info.of_unit ? "no unit " + std::to_string(fault.unit.value)
                                          : "no bus " + std::to_string(fault.bus.value));
    if (!(fault.chance >= 0 && fault.chance <= 1)) return complain(fault, "chance is not in 0..1");
    if (fault.from.ns < 0 || fault.to <= fault.from)
      return complain(fault, "does not end after it begins");
    if (info.value != nullptr && !(fault.value >= info.value_min && fault.value <= info.value_max))
      return complain(fault, std::string(info.value) + " is out of range");
    if (info.needs_bit_clock && !config.bit_clock)
      return complain(fault, "needs a bit clock; a real interface has its own");
  }
  return {};
}

}  // namespace

Status World::Validate(const WorldConfig& config) {
  if (config.units.size() > limits::kUnits)
    return Fail(ErrorCode::kInvalid, std::to_string(config.units.size()) + " units; the limit is " +
                                         std::to_string(limits::kUnits));
  if (config.drive.subdivision < 6 || config.drive.counter1 < 1 || config.drive.repeat < 1 ||
      config.drive.v_bus_V <= 0)
    return Fail(ErrorCode::kInvalid, "the factory drive has a number out of range");
  std::unordered_set<std::uint32_t> ids;
  std::unordered_set<std::uint64_t> addresses;
  for (const UnitDescription& unit : config.units) {
    FOCALFLEET_TRY(ValidateUnit(unit, config.drive));
    if (unit.sensors > 0 && config.joint_sensors == nullptr)
      return Complain(unit, "has sensors, and there is no field for them to see");
    if (!ids.insert(unit.id.value).second) return Complain(unit, "stands here twice");
    if (!addresses.insert(std::uint64_t{unit.bus.value} << 8 | unit.node.value).second)
      return Complain(unit, "bus " + std::to_string(unit.bus.value) + " node " +
                                std::to_string(unit.node.value) + " is taken already");
  }
  return ValidateFaults(config);
}

World::World(WorldConfig config) : schedule_(std::move(config.faults), config.start, config.seed) {
  core_ = std::make_unique<WorldCore>(std::move(config));
  schedule_.Apply(this);
}
World::~World() = default;

bool World::Inject(BusId bus, const CanFrame& frame, HostInstant at, std::uint32_t client) {
  return core_->Inject(bus, {frame, false, client}, at);
}
void World::AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
                      std::vector<WireFrame>* wire) {
  while (schedule_.next() <= at) {
    core_->AdvanceTo(schedule_.next(), delivered, wire);
    schedule_.Apply(this);
  }
  core_->AdvanceTo(at, delivered, wire);
}
HostInstant World::NextEvent() const { return std::min(core_->NextEvent(), schedule_.next()); }
HostInstant World::now() const { return core_->now(); }

void World::PulseSync() { core_->PulseSync(); }
bool World::dead(BusId bus) const { return core_->At(bus).bus.dead(); }
std::size_t World::waiting(BusId bus) const { return core_->At(bus).bus.waiting(); }

std::span<const UnitDescription> World::units() const { return core_->config().units; }
std::span<const BusId> World::buses() const { return core_->buses(); }
std::optional<std::size_t> World::Find(UnitId unit) const { return core_->Find(unit); }
UnitTruth World::Truth(UnitId unit) const { return Truth(core_->Row(unit)); }
const Flash& World::flash(UnitId unit) const { return core_->unit(core_->Row(unit)).flash(); }
BusCounters World::counters(BusId bus) const { return core_->At(bus).bus.counters(); }
Controller World::controller(BusId bus) const {
  return ControllerOf(core_->At(bus).bus.node(kHostNode));
}
Controller World::controller(UnitId unit) const {
  Controller controller;
  core_->OnBusOf(core_->Row(unit), [&](const Bus* bus, std::uint32_t node) {
    controller = ControllerOf(bus->node(node));
  });
  return controller;
}

UnitTruth World::Truth(std::size_t row) const {
  const Unit& unit = core_->unit(row);
  UnitTruth truth;
  truth.id = units()[row].id;
  for (const Axis which : kAxes) {
    const std::size_t i = Index(which);
    truth.angle_deg[i] = unit.axis(which).AngleDeg(now());
    truth.vectors[i] =
        truth.angle_deg[i] * unit.flash().axis[i].subdivision * units()[row].axis[i].gear / 360;
    truth.applied[i] = unit.axis(which).Applied(now());
  }
  const auto fibre = FibreAt(unit.traits().mechanism, truth.angle_deg);
  truth.x_mm = fibre.real();
  truth.y_mm = fibre.imag();
  truth.state = unit.firmware().state();
  truth.fault = unit.firmware().fault();
  truth.powered = unit.firmware().powered();
  truth.interrupted = unit.firmware().interrupted();
  truth.moves_begun = unit.flash().moves_begun;
  truth.last_move = unit.last_begun();
  truth.begun_twice = unit.begun_twice();
  truth.began = unit.began();
  truth.clock_error = unit.traits().clock.rate - 1;
  return truth;
}

std::vector<UnitMemory> World::Memory() const {
  std::vector<UnitMemory> memory;
  memory.reserve(units().size());
  for (std::size_t row = 0; row < units().size(); ++row) {
    const Unit& unit = core_->unit(row);
    memory.push_back(
        {units()[row].id,
         unit.flash(),
         {unit.axis(Axis::kTheta).Memory(now()), unit.axis(Axis::kPhi).Memory(now())}});
  }
  return memory;
}

}  // namespace focalfleet::sim
