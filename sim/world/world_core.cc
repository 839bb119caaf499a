#include "sim/world/world_core.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"

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

}  // namespace

WorldCore::WorldCore(WorldConfig config)
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

bool WorldCore::Inject(BusId bus, const WaitingFrame& waiting, HostInstant at) {
  const auto found = segment_of_.find(bus);
  if (found == segment_of_.end()) return false;
  Wire& segment = segments_[found->second];
  const bool taken = segment.bus.Offer(waiting, std::max(at, now_));
  events_->Set(found->second, segment.bus.NextEvent());
  return taken;
}

void WorldCore::AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
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

void WorldCore::PulseSync() {
  for (std::uint32_t row = 0; row < units_.size(); ++row) {
    if (units_[row]->faults().deaf_to_sync) continue;
    TransmitQueue out;
    units_[row]->OnSync(now_, &out);
    Send(row, out);
  }
}

void WorldCore::PowerCut(std::uint32_t row) {
  units_[row]->firmware().PowerOff(now_);
  OnBusOf(row, [&](Bus* bus, std::uint32_t node) { bus->disturb().PowerOff(node, now_); });
  Reschedule(row);
}

void WorldCore::PowerOn(std::uint32_t row) {
  units_[row]->firmware().PowerOn(now_);
  OnBusOf(row, [&](Bus* bus, std::uint32_t node) { bus->disturb().PowerOn(node, now_); });
  Reschedule(row);
}

void WorldCore::RaiseFault(std::uint32_t row, const Firmware::Trip& trip) {
  TransmitQueue out;
  units_[row]->firmware().RaiseFault(trip, now_, &out);
  Send(row, out);
}

std::optional<std::size_t> WorldCore::Find(UnitId unit) const {
  const auto found = row_of_.find(unit);
  if (found == row_of_.end()) return std::nullopt;
  return found->second;
}

std::uint32_t WorldCore::Row(UnitId unit) const {
  const auto found = row_of_.find(unit);
  FOCALFLEET_CHECK(found != row_of_.end());
  return found->second;
}

Wire* WorldCore::Find(BusId bus) {
  const auto found = segment_of_.find(bus);
  return found == segment_of_.end() ? nullptr : &segments_[found->second];
}

void WorldCore::MakeBuses() {
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

void WorldCore::MakeUnits() {
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

void WorldCore::AdvanceBus(std::size_t slot, std::vector<ReceivedFrame>* delivered,
                           std::vector<WireFrame>* wire) {
  Wire& segment = segments_[slot];
  Bus::Heard heard;
  if (segment.bus.Advance(&heard) && !heard.lost) {
    const WaitingFrame& sent = heard.sent;
    if (wire != nullptr)
      wire->push_back(
          {segment.id, heard.at, sent.frame, sent.from_unit, sent.from_unit ? 0 : sent.sender});
    if (!sent.from_unit) {
      Deliver(segment, heard);
    } else if (segment.bus.node(kHostNode).hears() && heard.but_not != kHostNode) {
      delivered->push_back({segment.id, heard.at, sent.frame});
    }
  }
  events_->Set(slot, segment.bus.NextEvent());
}

// The acceptance filters of the units let through their own node's frames and the broadcast.
void WorldCore::Deliver(Wire& segment, const Bus::Heard& heard) {
  const auto node = static_cast<std::uint8_t>(heard.sent.frame.id >> 11);
  if (node == kBroadcastNode.value) {
    for (const std::uint32_t row : segment.rows) DeliverTo(row, heard);
  } else if (segment.row_of_node[node] != kNobody) {
    DeliverTo(segment.row_of_node[node], heard);
  }
}

void WorldCore::DeliverTo(std::uint32_t row, const Bus::Heard& heard) {
  const std::uint32_t node = node_of_row_[row];
  if (!segments_[bus_of_row_[row]].bus.node(node).hears() || heard.but_not == node) return;
  if (units_[row]->faults().deaf) {
    units_[row]->faults().Acts(UnitFaults::Kind::kDeaf);
    return;
  }
  TransmitQueue out;
  units_[row]->OnFrame(heard.sent.frame, now_, &out);
  Send(row, out);
}

void WorldCore::Send(std::uint32_t row, const TransmitQueue& out) {
  UnitFaults& faults = units_[row]->faults();
  Wire& segment = segments_[bus_of_row_[row]];
  if (faults.silent && !out.frames().empty()) {
    faults.Acts(UnitFaults::Kind::kSilent);
  } else if (!out.frames().empty()) {
    if (faults.late.ns > 0) faults.Acts(UnitFaults::Kind::kLate);
    if (faults.copies > 1) faults.Acts(UnitFaults::Kind::kCopies);
    const HostInstant ready = now_ + config_.answer_delay + faults.late;
    for (const CanFrame& frame : out.frames())
      for (int copy = 0; copy < faults.copies; ++copy)
        segment.bus.Offer({frame, true, node_of_row_[row]}, ready);
    events_->Set(bus_of_row_[row], segment.bus.NextEvent());
  }
  Reschedule(row);
}

void WorldCore::Reschedule(std::uint32_t row) {
  events_->Set(segments_.size() + row, units_[row]->firmware().deadline());
}

}  // namespace focalfleet::sim
