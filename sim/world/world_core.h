// The parts of a world: all buses and units, and the queue of their next events.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "sim/world/axis/motor.h"
#include "sim/world/bus/bus.h"
#include "sim/world/event_queue.h"
#include "sim/world/unit/unit.h"
#include "sim/world/world.h"

namespace focalfleet::sim {

struct Wire {  // a bus with its nodes
  BusId id;
  Bus bus;
  std::array<std::uint32_t, 256> row_of_node{};
  std::vector<std::uint32_t> rows;  // of the bus' nodes 1, 2 ...; node 0 is the host
};

class WorldCore {
 public:
  explicit WorldCore(WorldConfig config);

  // ---- the operations of World, at now() or up to `at`

  bool Inject(BusId bus, const WaitingFrame& waiting, HostInstant at);
  void AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
                 std::vector<WireFrame>* wire);
  void PulseSync();
  void PowerCut(std::uint32_t row);
  void PowerOn(std::uint32_t row);
  void RaiseFault(std::uint32_t row, const Firmware::Trip& trip);
  /// An act on a bus changes the instant of its next event. Pre: there is such a bus.
  template <class Act>
  void OnBus(BusId bus, const Act& act) {
    const std::size_t slot = segment_of_.at(bus);
    act(&segments_[slot].bus);
    events_->Set(slot, segments_[slot].bus.NextEvent());
  }
  /// As OnBus, for the bus of a unit and the unit's node on it.
  template <class Act>
  void OnBusOf(std::uint32_t row, const Act& act) {
    OnBus(segments_[bus_of_row_[row]].id, [&](Bus* bus) { act(bus, node_of_row_[row]); });
  }

  // ---- access

  [[nodiscard]] std::optional<std::size_t> Find(UnitId unit) const;
  [[nodiscard]] std::uint32_t Row(UnitId unit) const;  // Pre: it exists
  [[nodiscard]] Wire* Find(BusId bus);                 // null: there is none
  [[nodiscard]] const Wire& At(BusId bus) const { return segments_[segment_of_.at(bus)]; }

  [[nodiscard]] const WorldConfig& config() const { return config_; }
  [[nodiscard]] std::span<const BusId> buses() const { return buses_; }
  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] HostInstant NextEvent() const { return events_->next(); }
  [[nodiscard]] Unit& unit(std::size_t row) { return *units_[row]; }

 private:
  void MakeBuses();
  void MakeUnits();
  void AdvanceBus(std::size_t slot, std::vector<ReceivedFrame>* delivered,
                  std::vector<WireFrame>* wire);
  void Deliver(Wire& segment, const Bus::Heard& heard);
  void DeliverTo(std::uint32_t row, const Bus::Heard& heard);
  void Send(std::uint32_t row, const TransmitQueue& out);
  void Reschedule(std::uint32_t row);

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

}  // namespace focalfleet::sim
