#include "daemon/ports/simulated_port.h"

#include <linux/can/error.h>

#include <algorithm>
#include <utility>

#include "sim/hall/fibre_carrier.h"

namespace focalfleet {
namespace {

/// The error frame by which a SocketCAN driver would report it.
can_frame ErrorFrameOf(sim::FrameError error) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG;
  switch (error) {
    case sim::FrameError::kAcknowledgement:
      frame.can_id |= CAN_ERR_ACK;
      break;
    case sim::FrameError::kBit:
      frame.can_id |= CAN_ERR_PROT;
      frame.data[2] = CAN_ERR_PROT_BIT;
      break;
    case sim::FrameError::kStuff:
      frame.can_id |= CAN_ERR_PROT;
      frame.data[2] = CAN_ERR_PROT_STUFF;
      break;
    case sim::FrameError::kForm:
    case sim::FrameError::kNone:
      frame.can_id |= CAN_ERR_PROT;
      frame.data[2] = CAN_ERR_PROT_FORM;
  }
  return frame;
}

}  // namespace

Result<std::shared_ptr<SimulatedFleet>> SimulatedFleet::Create(sim::WorldConfig config,
                                                               std::optional<HostClock> clock) {
  FOCALFLEET_TRY(sim::World::Validate(config));
  return std::shared_ptr<SimulatedFleet>(new SimulatedFleet(std::move(config), clock));
}

// The world may still stand at its last event, before the frame is sent, so the clock gives the
// time.
bool SimulatedFleet::Inject(BusId bus, const CanFrame& frame) {
  return world_.Inject(bus, frame, clock_ ? clock_->Now() : world_.now());
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
    description.sensors = unit.sensors;
    description.fibre_carrier_mm = unit.carrier_mm;
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

std::shared_ptr<const sim::JointSensors> MakeJoints(const Layout& layout, std::uint64_t seed,
                                                    sim::Spread spread) {
  const bool any =
      std::ranges::any_of(layout.units(), [](const Unit& unit) { return unit.sensors > 0; });
  if (!any) return nullptr;
  sim::FibreCarrierMake make{.seed = seed};
  if (spread == sim::Spread::kReal) make.gain_sd = 5e-4, make.offset_sd_V = 2e-4;
  return std::make_shared<sim::FibreCarrierJoints>(make);
}

bool SimulatedLink::Look(const sim::World& world) {
  const sim::Controller controller = world.controller(bus_);
  const auto errors = world.counters(bus_).wire.errors;
  for (std::size_t kind = 0; kind < errors.size(); ++kind) {
    const std::uint64_t more = errors[kind] - std::exchange(counted_[kind], errors[kind]);
    if (more == 0) continue;
    tally_.Note(ErrorFrameOf(static_cast<sim::FrameError>(kind)), more);
    errors_seen_ += more;
  }
  LinkState state = LinkState::kUp;
  std::string trouble;
  if (controller.state == sim::Confinement::kOff) {
    state = LinkState::kOff;
    trouble = "the controller is bus-off";
  } else if (controller.state == sim::Confinement::kPassive) {
    state = LinkState::kPassive;
    trouble = "the controller is error-passive";
  } else if (controller.warns) {
    trouble = "the controller warns of errors";
  }
  // A trouble is reported once; its causes are still counted.
  if (state == state_ && trouble.empty() == trouble_.empty()) return false;
  if (!trouble.empty())
    if (const std::string causes = tally_.Causes(); !causes.empty()) trouble += " (" + causes + ")";
  state_ = state;
  trouble_ = std::move(trouble);
  if (trouble_.empty()) tally_.Clear();
  return true;
}

SimulatedPort::SimulatedPort(std::shared_ptr<SimulatedFleet> fleet, BusId bus)
    : fleet_(std::move(fleet)),
      bus_(bus),
      name_("simulated bus " + std::to_string(bus.value)),
      link_(bus) {}

std::size_t SimulatedPort::Send(std::span<const CanFrame> frames) {
  std::size_t taken = 0;
  while (taken < frames.size() && fleet_->Inject(bus_, frames[taken])) ++taken;
  return taken;
}

void SimulatedPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  fleet_->Take(bus_, now, out);
  link_.Look(fleet_->world());
  counters_.link_errors = link_.errors();
}

LinkState SimulatedPort::state() const {
  return fleet_->dead(bus_) ? LinkState::kDown : link_.state();
}

}  // namespace focalfleet
