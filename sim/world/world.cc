#include "sim/world/world.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "sim/world/event_queue.h"
#include "sim/world/unit/unit.h"

namespace focalfleet::sim {
namespace {

constexpr std::uint32_t kFirstSerial = 1'000'000;
constexpr std::uint32_t kNobody = UINT32_MAX;

Flash FactoryFlash(const UnitDescription& description, const FactoryDrive& drive,
                   std::uint64_t seed) {
  Flash flash;
  flash.serial = description.serial.value != 0 ? description.serial
                                               : SerialNumber{kFirstSerial + description.id.value};
  flash.host_timeout_ms = drive.host_timeout_ms;
  const auto pose_deg = FirstPoseDeg(description, seed);
  for (const Axis which : kAxes) {
    const AxisDescription& described = description.axis[Index(which)];
    AxisFlash& axis = flash.axis[Index(which)];
    axis.subdivision = static_cast<std::uint16_t>(drive.subdivision);
    axis.counter1 = static_cast<std::uint16_t>(drive.counter1);
    axis.repeat = static_cast<std::uint8_t>(drive.repeat);
    axis.mode = drive.mode;
    const FactoryRange range = FactoryRangeOf(described, which, drive.subdivision);
    axis.min_position = range.min_position;
    axis.max_position = range.max_position;
    axis.home_position = range.home_position;
    axis.set_position(static_cast<std::int32_t>(
        std::lround(pose_deg[Index(which)] * drive.subdivision * described.gear / 360)));
  }
  return flash;
}

Unit::Parts MakeParts(const UnitDescription& description, const WorldConfig& config,
                      const Motor* motor, const UnitMemory* memory) {
  const UnitTraits traits =
      DrawTraits(description, {config.seed, config.spread, config.clock_error_max,
                               config.drive.subdivision, config.planted});
  const Flash flash =
      memory != nullptr ? memory->flash : FactoryFlash(description, config.drive, config.seed);
  const auto axis = [&](Axis which) {
    const std::size_t i = Index(which);
    if (memory != nullptr) return AxisModel(traits.axis[i], motor, memory->axis[i]);
    return AxisModel(traits.axis[i], motor,
                     AxisModel::Start{flash.axis[i].position(), flash.axis[i].subdivision,
                                      description.axis[i].gear});
  };
  return {description,
          traits,
          flash,
          {axis(Axis::kTheta), axis(Axis::kPhi)},
          config.joint_sensors.get()};
}

struct Wire {  // a bus with its nodes
  BusId id;
  Bus bus;
  std::array<std::uint32_t, 256> row_of_node{};
  std::vector<std::uint32_t> rows;  // of the bus' nodes 1, 2 ...; node 0 is the host
};

Controller ControllerOf(const Bus& bus, std::uint32_t node) {
  const ErrorCounters& errors = bus.errors(node);
  return {bus.state(node), errors.warns(), errors.transmit(), errors.receive()};
}

Status Complain(const UnitDescription& unit, const std::string& what) {
  return Fail(ErrorCode::kInvalid, "unit " + std::to_string(unit.id.value) + ": " + what);
}

Status ValidateUnit(const UnitDescription& unit, const FactoryDrive& drive) {
  if (unit.sensors > limits::kSensorsPerUnit) return Complain(unit, "has too many sensors");
  if (unit.sensors > 0 && !(unit.fibre_carrier_mm > 0 && std::isfinite(unit.fibre_carrier_mm)))
    return Complain(unit, "has sensors at its joint, and no spine on it");
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

class World::Impl {
 public:
  explicit Impl(WorldConfig config)
      : config_(std::move(config)),
        motor_({.bridge = {.v_bus_V = config_.drive.v_bus_V}},
               {.counter1 = config_.drive.counter1,
                .repeat = config_.drive.repeat,
                .subdivision = config_.drive.subdivision,
                .mode = config_.drive.mode}),
        now_(config_.start) {
    MakeBuses();
    events_.emplace(segments_.size() + config_.units.size());
    MakeUnits();
  }

  bool Inject(BusId bus, const Bus::Waiting& waiting, HostInstant at) {
    const auto found = segment_of_.find(bus);
    if (found == segment_of_.end()) return false;
    Wire& segment = segments_[found->second];
    const bool taken = segment.bus.Offer(waiting, std::max(at, now_));
    events_->Set(found->second, segment.bus.NextEvent());
    return taken;
  }

  void AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
                 std::vector<WireFrame>* wire) {
    while (events_->next() <= at) {
      now_ = std::max(now_, events_->next());
      const std::size_t slot = events_->slot();
      if (slot < segments_.size()) {
        AdvanceBus(slot, delivered, wire);
      } else {
        TransmitQueue out;
        const auto row = static_cast<std::uint32_t>(slot - segments_.size());
        units_[row]->OnTime(now_, &out);
        Send(row, out);
      }
    }
    now_ = std::max(now_, at);
  }

  void PulseSync() {
    for (std::uint32_t row = 0; row < units_.size(); ++row) {
      if (units_[row]->faults().deaf_to_sync) continue;
      TransmitQueue out;
      units_[row]->OnSync(now_, &out);
      Send(row, out);
    }
  }
  void PowerCut(std::uint32_t row) {
    units_[row]->firmware().PowerOff(now_);
    OnBusOf(row, [&](Bus* bus, std::uint32_t node) { bus->PowerOff(node, now_); });
    Reschedule(row);
  }
  void PowerOn(std::uint32_t row) {
    units_[row]->firmware().PowerOn(now_);
    OnBusOf(row, [&](Bus* bus, std::uint32_t node) { bus->PowerOn(node, now_); });
    Reschedule(row);
  }
  /// An act on a bus changes the instant of its next event.
  template <class Act>
  void OnBus(std::size_t slot, const Act& act) {
    act(&segments_[slot].bus);
    events_->Set(slot, segments_[slot].bus.NextEvent());
  }
  template <class Act>
  void OnBusOf(std::uint32_t row, const Act& act) {
    OnBus(bus_of_row_[row], [&](Bus* bus) { act(bus, node_of_row_[row]); });
  }
  void RaiseFault(std::uint32_t row, const Firmware::Trip& trip) {
    TransmitQueue out;
    units_[row]->firmware().RaiseFault(trip, now_, &out);
    Send(row, out);
  }
  [[nodiscard]] std::size_t Slot(BusId bus) const { return segment_of_.at(bus); }

  [[nodiscard]] UnitTruth Truth(std::size_t row) const;
  [[nodiscard]] std::vector<UnitMemory> Memory() const;

  [[nodiscard]] std::optional<std::size_t> Find(UnitId unit) const {
    const auto found = row_of_.find(unit);
    if (found == row_of_.end()) return std::nullopt;
    return found->second;
  }
  [[nodiscard]] std::uint32_t Row(UnitId unit) const {
    const auto found = row_of_.find(unit);
    FOCALFLEET_CHECK(found != row_of_.end());
    return found->second;
  }
  [[nodiscard]] Wire* Find(BusId bus) {
    const auto found = segment_of_.find(bus);
    return found == segment_of_.end() ? nullptr : &segments_[found->second];
  }
  [[nodiscard]] const Wire& At(BusId bus) const { return segments_[segment_of_.at(bus)]; }

  [[nodiscard]] const WorldConfig& config() const { return config_; }
  [[nodiscard]] std::span<const BusId> buses() const { return buses_; }
  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] HostInstant NextEvent() const { return events_->next(); }
  [[nodiscard]] Unit& unit(std::size_t row) { return *units_[row]; }

 private:
  void MakeBuses() {
    for (const UnitDescription& unit : config_.units) buses_.push_back(unit.bus);
    std::sort(buses_.begin(), buses_.end());
    buses_.erase(std::unique(buses_.begin(), buses_.end()), buses_.end());
    segments_.reserve(buses_.size());
    for (const BusId id : buses_) {
      segment_of_[id] = segments_.size();
      segments_.push_back({id,
                           Bus({.bit_rate_bps = config_.bit_rate_bps,
                                .bit_clock = config_.bit_clock,
                                .mailboxes_max = limits::kFramesPerBusQueued,
                                .start = config_.start,
                                .host_restart = config_.host_restart},
                               Rng::Stream(config_.seed, "bus", id.value)),
                           {},
                           {}});
      segments_.back().row_of_node.fill(kNobody);
    }
  }

  void MakeUnits() {
    std::unordered_map<UnitId, const UnitMemory*> remembered;
    for (const UnitMemory& memory : config_.memory) remembered[memory.id] = &memory;
    units_.reserve(config_.units.size());
    for (std::uint32_t row = 0; row < config_.units.size(); ++row) {
      const UnitDescription& described = config_.units[row];
      const auto memory = remembered.find(described.id);
      units_.push_back(std::make_unique<Unit>(MakeParts(
          described, config_, &motor_, memory == remembered.end() ? nullptr : memory->second)));
      row_of_[described.id] = row;
      bus_of_row_.push_back(segment_of_.at(described.bus));
      Wire& segment = segments_[bus_of_row_.back()];
      segment.row_of_node[described.node.value] = row;
      segment.rows.push_back(row);
      node_of_row_.push_back(segment.bus.Attach());
      PowerOn(row);
    }
    config_.memory.clear();
  }

  void AdvanceBus(std::size_t slot, std::vector<ReceivedFrame>* delivered,
                  std::vector<WireFrame>* wire) {
    Wire& segment = segments_[slot];
    Bus::Heard heard;
    if (segment.bus.Advance(&heard) && !heard.lost) {
      const Bus::Waiting& sent = heard.sent;
      if (wire != nullptr)
        wire->push_back(
            {segment.id, heard.at, sent.frame, sent.from_unit, sent.from_unit ? 0 : sent.sender});
      if (!sent.from_unit) {
        Deliver(segment, heard);
      } else if (segment.bus.Hears(Bus::kHost) && heard.but_not != Bus::kHost) {
        delivered->push_back({segment.id, heard.at, sent.frame});
      }
    }
    events_->Set(slot, segment.bus.NextEvent());
  }

  // The acceptance filters of the units let through their own node's frames and the broadcast.
  void Deliver(Wire& segment, const Bus::Heard& heard) {
    const auto node = static_cast<std::uint8_t>(heard.sent.frame.id >> 11);
    if (node == kBroadcastNode.value) {
      for (const std::uint32_t row : segment.rows) DeliverTo(row, heard);
    } else if (segment.row_of_node[node] != kNobody) {
      DeliverTo(segment.row_of_node[node], heard);
    }
  }

  void DeliverTo(std::uint32_t row, const Bus::Heard& heard) {
    const std::uint32_t node = node_of_row_[row];
    if (!segments_[bus_of_row_[row]].bus.Hears(node) || heard.but_not == node) return;
    if (units_[row]->faults().deaf) return;
    TransmitQueue out;
    units_[row]->OnFrame(heard.sent.frame, now_, &out);
    Send(row, out);
  }

  void Send(std::uint32_t row, const TransmitQueue& out) {
    const UnitFaults& faults = units_[row]->faults();
    Wire& segment = segments_[bus_of_row_[row]];
    if (!faults.silent && !out.frames().empty()) {
      const HostInstant ready = now_ + config_.answer_delay + faults.late;
      for (const CanFrame& frame : out.frames())
        for (int copy = 0; copy < faults.copies; ++copy)
          segment.bus.Offer({frame, true, node_of_row_[row]}, ready);
      events_->Set(bus_of_row_[row], segment.bus.NextEvent());
    }
    Reschedule(row);
  }

  void Reschedule(std::uint32_t row) {
    events_->Set(segments_.size() + row, units_[row]->firmware().deadline());
  }

  WorldConfig config_;
  Motor motor_;
  HostInstant now_;
  std::vector<BusId> buses_;
  std::vector<Wire> segments_;
  std::map<BusId, std::size_t> segment_of_;
  std::vector<std::unique_ptr<Unit>> units_;
  std::vector<std::size_t> bus_of_row_;
  std::vector<std::uint32_t> node_of_row_;  // on its bus
  std::unordered_map<UnitId, std::uint32_t> row_of_;
  std::optional<EventQueue> events_;  // slots: buses, then units
};

UnitTruth World::Impl::Truth(std::size_t row) const {
  const Unit& unit = *units_[row];
  UnitTruth truth;
  truth.id = config_.units[row].id;
  for (const Axis which : kAxes) {
    const std::size_t i = Index(which);
    truth.angle_deg[i] = unit.axis(which).AngleDeg(now_);
    truth.vectors[i] = truth.angle_deg[i] * unit.flash().axis[i].subdivision *
                       config_.units[row].axis[i].gear / 360;
    truth.applied[i] = unit.axis(which).Applied(now_);
  }
  const auto fibre = FibreAt(unit.traits().mechanism, truth.angle_deg);
  truth.x_mm = fibre.real();
  truth.y_mm = fibre.imag();
  truth.state = unit.firmware().state();
  truth.fault = unit.firmware().fault();
  truth.powered = unit.firmware().powered();
  truth.interrupted = unit.firmware().interrupted();
  truth.moves_begun = unit.flash().moves_begun;
  truth.last_move = unit.flash().last_begun;
  truth.begun_twice = unit.begun_twice();
  truth.began = unit.began();
  truth.clock_error = unit.traits().clock.rate - 1;
  return truth;
}

std::vector<UnitMemory> World::Impl::Memory() const {
  std::vector<UnitMemory> memory;
  memory.reserve(units_.size());
  for (std::size_t row = 0; row < units_.size(); ++row) {
    const Unit& unit = *units_[row];
    memory.push_back({config_.units[row].id,
                      unit.flash(),
                      {unit.axis(Axis::kTheta).Memory(now_), unit.axis(Axis::kPhi).Memory(now_)}});
  }
  return memory;
}

World::World(WorldConfig config) : schedule_(std::move(config.faults), config.start, config.seed) {
  impl_ = std::make_unique<Impl>(std::move(config));
  schedule_.Apply(this);
}
World::~World() = default;

bool World::Inject(BusId bus, const CanFrame& frame, HostInstant at, std::uint32_t client) {
  return impl_->Inject(bus, {frame, false, client}, at);
}
void World::AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
                      std::vector<WireFrame>* wire) {
  while (schedule_.next() <= at) {
    impl_->AdvanceTo(schedule_.next(), delivered, wire);
    schedule_.Apply(this);
  }
  impl_->AdvanceTo(at, delivered, wire);
}
HostInstant World::NextEvent() const { return std::min(impl_->NextEvent(), schedule_.next()); }
HostInstant World::now() const { return impl_->now(); }

void World::PulseSync() { impl_->PulseSync(); }
void World::PowerCut(UnitId unit) { impl_->PowerCut(impl_->Row(unit)); }
void World::PowerOn(UnitId unit) { impl_->PowerOn(impl_->Row(unit)); }
void World::KillBus(BusId bus) {
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->Kill(now()); });
}
void World::ReviveBus(BusId bus) {
  if (impl_->Find(bus) == nullptr) return;
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->Revive(now()); });
}
void World::StickBus(BusId bus) {
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->Stick(now()); });
}
void World::ReleaseBus(BusId bus) {
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->Release(now()); });
}
void World::RestartHost(BusId bus) {
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->RestartHost(now()); });
}
void World::ThrowHostOff(BusId bus) {
  impl_->OnBus(impl_->Slot(bus), [this](Bus* wire) { wire->ThrowHostOff(now()); });
}
void World::Unplug(UnitId unit) {
  impl_->OnBusOf(impl_->Row(unit),
                 [this](Bus* wire, std::uint32_t node) { wire->Unplug(node, now()); });
}
void World::Plug(UnitId unit) {
  impl_->OnBusOf(impl_->Row(unit),
                 [this](Bus* wire, std::uint32_t node) { wire->Plug(node, now()); });
}
void World::Babble(UnitId unit, const std::optional<CanFrame>& frame) {
  impl_->OnBusOf(impl_->Row(unit),
                 [&](Bus* wire, std::uint32_t node) { wire->Babble(node, frame, now()); });
}
bool World::dead(BusId bus) const { return impl_->At(bus).bus.dead(); }
std::size_t World::waiting(BusId bus) const { return impl_->At(bus).bus.waiting(); }
void World::RaiseFault(UnitId unit, FaultCode code, Axis axis) {
  impl_->RaiseFault(impl_->Row(unit), {code, axis});
}
UnitFaults* World::faults(UnitId unit) {
  const auto row = impl_->Find(unit);
  return row ? &impl_->unit(*row).faults() : nullptr;
}
BusFaults* World::faults(BusId bus) {
  Wire* segment = impl_->Find(bus);
  return segment != nullptr ? &segment->bus.faults() : nullptr;
}

std::span<const UnitDescription> World::units() const { return impl_->config().units; }
std::span<const BusId> World::buses() const { return impl_->buses(); }
std::optional<std::size_t> World::Find(UnitId unit) const { return impl_->Find(unit); }
UnitTruth World::Truth(std::size_t row) const { return impl_->Truth(row); }
UnitTruth World::Truth(UnitId unit) const { return impl_->Truth(impl_->Row(unit)); }
const Flash& World::flash(UnitId unit) const { return impl_->unit(impl_->Row(unit)).flash(); }
const BusCounters& World::counters(BusId bus) const { return impl_->At(bus).bus.counters(); }
Controller World::controller(BusId bus) const {
  return ControllerOf(impl_->At(bus).bus, Bus::kHost);
}
Controller World::controller(UnitId unit) const {
  Controller controller;
  impl_->OnBusOf(impl_->Row(unit), [&](const Bus* wire, std::uint32_t node) {
    controller = ControllerOf(*wire, node);
  });
  return controller;
}
std::vector<UnitMemory> World::Memory() const { return impl_->Memory(); }

}  // namespace focalfleet::sim
