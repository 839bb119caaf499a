// The frames that carry a configuration, out of a log of all: stage, read-back, arm, start, done.
// What legitimately differs between two runs of the same configuration is masked: sequence numbers
// and the time that a start signal still leaves. The same frame of a move again (a repeat) is
// counted apart, and so is everything else: polls, clock, identification.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "protocol/wire/identifier.h"
#include "tests/can/bus_story.h"

namespace focalfleet::test {

struct MaskedFrame {
  std::uint32_t id = 0;
  std::array<std::uint8_t, 8> data{};
  std::uint16_t move = 0;  // to which it belongs; a segment's is told by the begin before it
  auto operator<=>(const MaskedFrame&) const = default;
};

struct FrameCount {
  std::uint64_t host = 0;
  std::uint64_t unit = 0;
};

struct ConfigurationFrames {
  /// By interface and node, broadcasts under kBroadcastNode: each frame once, as it first came.
  std::map<BusNode, std::vector<MaskedFrame>> of_unit;
  std::map<std::string, std::uint64_t> repeats;    // by interface
  std::array<FrameCount, kFunctionCount> count{};  // all frames of the log
  std::uint64_t malformed = 0;
  double seconds = 0;  // from the first frame to the last
};

ConfigurationFrames SortOut(const CandumpLog& log);

}  // namespace focalfleet::test
