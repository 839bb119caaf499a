// ConfigurationFrames are the frames of a log that carry a configuration: stage, read-back, arm,
// start, done. Fields that legitimately differ between two runs of the same configuration are
// masked. They are sequence numbers and the time that a start signal still leaves. Repeats of a
// frame of a move are counted apart, and so are all other frames: polls, clock, identification.
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
  std::uint16_t move = 0;  // its move; a segment's is that of the begin before it
  auto operator<=>(const MaskedFrame&) const = default;
};

struct FrameCount {
  std::uint64_t host = 0;
  std::uint64_t unit = 0;
};

struct ConfigurationFrames {
  /// Frames by interface and node, broadcasts under kBroadcastNode: each frame once, as it first
  /// came.
  std::map<BusNode, std::vector<MaskedFrame>> of_unit;
  std::map<std::string, std::uint64_t> repeats;    // by interface
  std::array<FrameCount, kFunctionCount> count{};  // all frames of the log
  std::uint64_t malformed = 0;
  double seconds = 0;  // from the first frame to the last
};

ConfigurationFrames SortOut(const CandumpLog& log);

}  // namespace focalfleet::test
