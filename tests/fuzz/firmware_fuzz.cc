// The test runs a unit under a host that may send anything at any time, and whose power may go. The
// input is records of 12 bytes: event (1), delay (1), function and address (2), data (8). For any
// input the unit answers in well-formed frames of its own node. Its FLASH stays a possible one, and
// the unit never moves without the mark.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/wire/codec.h"
#include "sim/world/world.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kRecord = 12;
constexpr std::size_t kRecordsMax = 200;
constexpr std::uint8_t kNode = 1;
constexpr UnitId kUnit{1};

WorldConfig OneUnit() {
  WorldConfig config;
  UnitDescription unit;
  unit.id = kUnit;
  unit.node = {kNode};
  unit.axis[0] = {8.25, 0, 892.06, -190, 190, 0.0};
  unit.axis[1] = {8.25, 0, 892.06, 0, 180, 90.0};
  config.units.push_back(unit);
  return config;
}

// A known function in the host's direction for this unit or for all, with any length, detail and
// data.
CanFrame FrameOf(const std::uint8_t* record) {
  const auto function = static_cast<Function>(record[2] % kFunctionCount);
  const NodeId node{(record[2] & 0x80u) != 0 ? kBroadcastNode.value : kNode};
  const auto sequence = static_cast<std::uint8_t>(record[3] >> 4);
  const auto detail = static_cast<std::uint8_t>((record[2] & 0x40u) != 0 ? 1 : 0);
  CanFrame frame{Pack({function, false, {node, sequence}, detail}),
                 static_cast<std::uint8_t>((record[3] & 15u) % 9),
                 {}};
  std::memcpy(frame.data.data(), record + 4, 8);
  return frame;
}

void CheckWorld(const World& world, const std::vector<ReceivedFrame>& heard) {
  for (const ReceivedFrame& received : heard) {
    const auto message = DecodeUnit(received.frame);
    FOCALFLEET_CHECK(message && message->address.node.value == kNode);
  }
  const Flash& flash = world.flash(kUnit);
  for (const AxisFlash& axis : flash.axis) {
    FOCALFLEET_CHECK(axis.subdivision > 0 && axis.vector < axis.subdivision);
    FOCALFLEET_CHECK(axis.position() >= -limits::kPositionMax);
    FOCALFLEET_CHECK(axis.position() <= limits::kPositionMax);
    FOCALFLEET_CHECK(axis.min_position <= axis.max_position);
  }
  const UnitState state = world.Truth(kUnit).state;
  const bool runs = state == UnitState::kMoving || state == UnitState::kHoming;
  FOCALFLEET_CHECK(!runs || flash.moving);
}

void Run(const std::uint8_t* data, std::size_t size) {
  World world(OneUnit());
  std::vector<ReceivedFrame> heard;
  for (std::size_t i = 0; i < kRecordsMax && size >= kRecord;
       ++i, data += kRecord, size -= kRecord) {
    switch (data[0] % 16) {
      case 0:
        world.disturb().PowerCut(kUnit);
        break;
      case 1:
        world.disturb().PowerOn(kUnit);
        break;
      case 2:
        world.disturb().RaiseFault(kUnit, static_cast<FaultCode>(data[2] % kFaultCodeCount));
        break;
      default:
        world.Inject({}, FrameOf(data), world.now());
    }
    // Delays reach from within one frame's time to beyond the host's time-out.
    heard.clear();
    world.AdvanceTo(world.now() + Microseconds(200) * (std::int64_t{1} << data[1] % 17), &heard);
    CheckWorld(world, heard);
  }
}

}  // namespace
}  // namespace focalfleet::sim

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  focalfleet::sim::Run(data, size);
  return 0;
}
