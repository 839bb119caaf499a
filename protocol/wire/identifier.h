// The 29-bit identifier, most significant field first, because the lowest number wins arbitration:
//
//   28..26 priority   25..20 function   19 from unit   18..11 node   10..3 sequence   2..0 detail
//
// The priority comes first, so that a stop passes every frame that waits. The node is part of the
// identifier, so that two units never send the same one. The sequence number is part of it as well:
// all eight bytes carry data, and an answer names the request that it belongs to. Begin, segments
// and read-back of an upload have one priority and ascending function numbers. A controller that
// sends its lowest waiting identifier first therefore keeps them in this order.
#pragma once

#include <cstdint>

#include "protocol/base/ids.h"

namespace focalfleet {

enum class Function : std::uint8_t {
  kStop = 0,
  kStart = 1,
  kDone = 2,
  kClock = 3,
  kArm = 4,
  kStageBegin = 5,
  kStageSegment = 6,
  kConfirm = 7,
  kHome = 8,
  kProgress = 9,
  kStatus = 10,
  kVector = 11,
  kFault = 12,
  kIdentify = 13,
  kParameterRead = 14,
  kParameterWrite = 15,
  kStageGroup = 16,  // in CAN FD frames alone (stage_group.h)
  kSensors = 17,
};
inline constexpr std::uint32_t kFunctionCount = 18;

struct FunctionRow {
  Function function;
  const char* name;
  std::uint8_t priority;  // 0 wins; the same for both directions
};

/// The table of all functions, in the order of their numbers.
inline constexpr FunctionRow kFunctions[kFunctionCount] = {
    {Function::kStop, "stop", 0},
    {Function::kStart, "start", 1},
    {Function::kDone, "done", 2},
    {Function::kClock, "clock", 2},
    {Function::kArm, "arm", 3},
    {Function::kStageBegin, "stage_begin", 4},
    {Function::kStageSegment, "stage_segment", 4},
    {Function::kConfirm, "confirm", 4},
    {Function::kHome, "home", 4},
    {Function::kProgress, "progress", 5},
    {Function::kStatus, "status", 5},
    {Function::kVector, "vector", 5},
    {Function::kFault, "fault", 5},
    {Function::kIdentify, "identify", 6},
    {Function::kParameterRead, "parameter_read", 6},
    {Function::kParameterWrite, "parameter_write", 6},
    {Function::kStageGroup, "stage_group", 4},
    {Function::kSensors, "sensors", 5},
};

constexpr const FunctionRow& InfoOf(Function function) {
  return kFunctions[static_cast<std::uint8_t>(function)];
}
constexpr const char* Name(Function function) { return InfoOf(function).name; }

/// The address says where a frame goes to or comes from, and which exchange it belongs to. An
/// answer repeats the sequence number of its request. A frame that a unit sends unasked carries 0.
struct Address {
  NodeId node;
  std::uint8_t sequence = 0;
  constexpr bool operator==(const Address&) const = default;
};

struct Identifier {
  Function function;
  bool from_unit = false;
  Address address;
  std::uint8_t detail = 0;  // 3 bits; its meaning depends on the function
};

constexpr std::uint32_t Pack(const Identifier& id) {
  return static_cast<std::uint32_t>(InfoOf(id.function).priority) << 26 |
         static_cast<std::uint32_t>(id.function) << 20 | (id.from_unit ? 1u << 19 : 0u) |
         static_cast<std::uint32_t>(id.address.node.value) << 11 |
         static_cast<std::uint32_t>(id.address.sequence) << 3 | (id.detail & 7u);
}

}  // namespace focalfleet
