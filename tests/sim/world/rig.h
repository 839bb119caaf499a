// A host for tests of the simulation. The host exchanges frames with one world, keeps the received
// ones, and can carry one unit through a whole move.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "protocol/wire/codec.h"
#include "protocol/wire/staged_move.h"
#include "sim/world/world.h"

namespace focalfleet::sim::test {

inline constexpr double kGear = 337.0 * 45 / 17;

inline UnitDescription DescribeUnit(std::uint32_t id, std::uint32_t bus, std::uint8_t node) {
  UnitDescription unit;
  unit.id = {id};
  unit.bus = {bus};
  unit.node = {node};
  unit.base_x_mm = 25.6 * id;
  unit.axis[0] = {8.25, 0, kGear, -190, 190, 0.0};
  unit.axis[1] = {8.25, 0, kGear, 0, 180, 90.0};
  return unit;
}

inline WorldConfig FleetOf(std::uint32_t buses, std::uint32_t per_bus) {
  WorldConfig config;
  for (std::uint32_t bus = 0; bus < buses; ++bus)
    for (std::uint32_t node = 1; node <= per_bus; ++node)
      config.units.push_back(
          DescribeUnit(bus * per_bus + node, bus, static_cast<std::uint8_t>(node)));
  return config;
}

inline StagedMove MakeMove(std::uint16_t move, std::int32_t theta, std::int32_t phi) {
  StagedMove staged{{move}, WaveMode::kAsymmetric, {}};
  staged.path[0].Append({0, theta, 108});
  staged.path[1].Append({0, phi, 108});
  return staged;
}

class Rig {
 public:
  explicit Rig(WorldConfig config) : world_(std::move(config)) {}

  World& world() { return world_; }
  std::vector<ReceivedFrame>& heard() { return heard_; }

  void Send(std::uint32_t bus, std::uint8_t node, const HostMessage& message,
            std::optional<std::uint8_t> sequence = std::nullopt) {
    sequence_ = sequence ? *sequence : static_cast<std::uint8_t>(sequence_ % 255 + 1);
    world_.Inject({bus}, Encode(message, {{node}, sequence_}), world_.now());
  }
  void Run(DurationNs duration) { world_.AdvanceTo(world_.now() + duration, &heard_, &wire_); }

  /// Like Run, with a clock frame every second on every bus, so that no unit enters kHostLost.
  void RunWatched(DurationNs duration) {
    const HostInstant end = world_.now() + duration;
    while (world_.now() < end) {
      for (const BusId bus : world_.buses()) Send(bus.value, 255, Clock{});
      Run(std::min(Milliseconds(1000), end - world_.now()));
    }
  }

  /// Sends a message and returns the first message of this node within 5 ms, if any.
  std::optional<UnitMessage> Ask(std::uint32_t bus, std::uint8_t node, const HostMessage& message,
                                 std::optional<std::uint8_t> sequence = std::nullopt) {
    heard_.clear();
    Send(bus, node, message, sequence);
    Run(Milliseconds(5));
    for (const ReceivedFrame& frame : heard_) {
      const auto decoded = DecodeUnit(frame.frame);
      if (decoded && decoded->address.node.value == node) return decoded->message;
    }
    return std::nullopt;
  }
  template <class M>
  std::optional<M> AskFor(std::uint32_t bus, std::uint8_t node, const HostMessage& message,
                          std::optional<std::uint8_t> sequence = std::nullopt) {
    const auto answer = Ask(bus, node, message, sequence);
    if (!answer || !std::holds_alternative<M>(*answer)) return std::nullopt;
    return std::get<M>(*answer);
  }

  void Stage(std::uint32_t bus, std::uint8_t node, const StagedMove& move) {
    Send(bus, node, StageBegin{move.move, {move.path[0].size(), move.path[1].size()}, move.mode});
    Run(Milliseconds(1));
    for (const Axis axis : kAxes) {
      std::uint8_t index = 0;
      for (const Segment& segment : move.path[Index(axis)].segments())
        Send(bus, node, StageSegment{axis, index++, segment});
    }
    Run(Milliseconds(8));
  }
  /// Stages and arms a move; returns the unit's answer to the arm.
  Answer StageAndArm(std::uint32_t bus, std::uint8_t node, const StagedMove& move) {
    Stage(bus, node, move);
    const auto reply = AskFor<ArmReply>(bus, node, Arm{move.move, Digest(move)});
    return reply ? reply->answer : Answer::kBadValue;
  }

  const std::vector<WireFrame>& wire() const { return wire_; }

 private:
  World world_;
  std::vector<ReceivedFrame> heard_;
  std::vector<WireFrame> wire_;
  std::uint8_t sequence_ = 0;
};

}  // namespace focalfleet::sim::test
