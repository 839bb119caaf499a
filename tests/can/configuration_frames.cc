#include "tests/can/configuration_frames.h"

#include <algorithm>
#include <optional>
#include <set>

#include "protocol/wire/codec.h"

namespace focalfleet::test {
namespace {

constexpr std::uint32_t kSequenceMask = 255u << 3;

bool CarriesConfiguration(Function function) {
  switch (function) {
    case Function::kStart:
    case Function::kDone:
    case Function::kArm:
    case Function::kStageBegin:
    case Function::kStageSegment:
    case Function::kConfirm:
      return true;
    default:
      return false;
  }
}

Function FunctionOf(const CanFrame& frame) { return static_cast<Function>(frame.id >> 20 & 63); }

struct MoveOf {
  std::uint16_t staged;  // move number of this unit, by its last begin
  std::uint16_t operator()(const StageSegment&) const { return staged; }
  template <class Message>
  std::uint16_t operator()(const Message& message) const {
    if constexpr (requires { message.move.value; }) return message.move.value;
    return 0;
  }
};

}  // namespace

ConfigurationFrames SortOut(const CandumpLog& log) {
  ConfigurationFrames out;
  std::map<BusNode, std::uint16_t> staged;
  std::map<BusNode, std::set<MaskedFrame>> seen;
  for (const LoggedFrame& logged : log.frames) {
    const auto host = DecodeHost(logged.frame);
    const auto unit = DecodeUnit(logged.frame);
    if (!host && !unit) {
      ++out.malformed;
      continue;
    }
    const Function function = FunctionOf(logged.frame);
    FrameCount& count = out.count[static_cast<std::size_t>(function)];
    ++(host ? count.host : count.unit);
    if (!CarriesConfiguration(function)) continue;
    const Address address = host ? host->address : unit->address;
    const BusNode where{logged.interface, address.node.value};
    const MoveOf move_of{staged[where]};
    MaskedFrame frame{.id = logged.frame.id & ~kSequenceMask, .data = logged.frame.data};
    frame.move = host ? std::visit(move_of, host->message) : std::visit(move_of, unit->message);
    if (function == Function::kStageBegin) staged[where] = frame.move;
    if (function == Function::kStart) std::fill(frame.data.begin() + 2, frame.data.end(), 0);
    if (!seen[where].insert(frame).second) {
      ++out.repeats[logged.interface];
    } else {
      out.of_unit[where].push_back(frame);
    }
  }
  if (!log.frames.empty())
    out.seconds = static_cast<double>(log.frames.back().at_us - log.frames.front().at_us) * 1e-6;
  return out;
}

}  // namespace focalfleet::test
