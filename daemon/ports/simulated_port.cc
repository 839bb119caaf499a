#include "daemon/ports/simulated_port.h"

#include <utility>

namespace focalfleet {

Result<std::shared_ptr<SimulatedFleet>> SimulatedFleet::Create(sim::WorldConfig config) {
  FOCALFLEET_TRY(sim::World::Validate(config));
  return std::shared_ptr<SimulatedFleet>(new SimulatedFleet(std::move(config)));
}

bool SimulatedFleet::Inject(BusId bus, const CanFrame& frame) {
  return world_.Inject(bus, frame, world_.now());
}

void SimulatedFleet::Take(BusId bus, HostInstant now, std::vector<ReceivedFrame>* out) {
  if (now > world_.now()) {
    delivered_.clear();
    world_.AdvanceTo(now, &delivered_);
    for (const ReceivedFrame& frame : delivered_) inbox_[frame.bus].push_back(frame);
  }
  auto& mine = inbox_[bus];
  out->insert(out->end(), mine.begin(), mine.end());
  mine.clear();
}

HostInstant SimulatedFleet::NextEvent(BusId bus) const {
  const auto it = inbox_.find(bus);
  return it != inbox_.end() && !it->second.empty() ? HostInstant{0} : world_.NextEvent();
}

std::vector<sim::UnitDescription> DescribeUnits(const Layout& layout) {
  std::vector<sim::UnitDescription> units;
  units.reserve(layout.size());
  for (const Unit& unit : layout.units()) {
    sim::UnitDescription description;
    description.id = unit.id;
    description.bus = unit.bus;
    description.node = unit.node;
    description.base_x_mm = unit.base_fp.x_mm;
    description.base_y_mm = unit.base_fp.y_mm;
    description.enabled = unit.enabled;
    for (const Axis axis : kAxes) {
      const AxisGeometry& from = unit.axis[Index(axis)];
      sim::AxisDescription& to = description.axis[Index(axis)];
      to.arm_mm = from.arm_mm;
      to.zero_deg = from.zero_deg;
      to.gear = from.gear;
      to.min_deg = from.min_deg;
      to.max_deg = from.max_deg;
    }
    units.push_back(description);
  }
  return units;
}

SimulatedPort::SimulatedPort(std::shared_ptr<SimulatedFleet> fleet, BusId bus)
    : fleet_(std::move(fleet)), bus_(bus), name_("simulated bus " + std::to_string(bus.value)) {}

std::size_t SimulatedPort::Send(std::span<const CanFrame> frames) {
  std::size_t taken = 0;
  while (taken < frames.size() && fleet_->Inject(bus_, frames[taken])) ++taken;
  return taken;
}

void SimulatedPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  fleet_->Take(bus_, now, out);
}

LinkState SimulatedPort::state() const {
  return fleet_->dead(bus_) ? LinkState::kDown : LinkState::kUp;
}

}  // namespace focalfleet
