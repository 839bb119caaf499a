// BusStory is the knowledge of a listener on the buses. The class holds which hardware answers
// where, and which move each unit was given, segment by segment. A record also holds whether the
// unit confirmed and armed the move, when it was started and where it reports that it ended. Frames
// are decoded with protocol/ alone; nothing comes from the coordinator.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocol/wire/codec.h"
#include "protocol/wire/staged_move.h"
#include "tests/can/candump_log.h"

namespace focalfleet::test {

struct OverheardMove {
  StagedMove staged;  // as uploaded, in the order of the segments' indices
  std::optional<Answer> confirmed;
  std::uint32_t confirmed_digest = 0;
  bool armed = false;
  std::vector<std::int64_t> started_us;  // start frames that reached it armed
  std::optional<Done> done;

  /// The length of the move of each axis. Units: vectors.
  [[nodiscard]] std::array<std::int32_t, kAxisCount> Way() const;
};

struct OverheardUnit {
  SerialNumber serial;                                     // 0: never identified
  std::map<std::uint16_t, OverheardMove> moves;            // by move id
  std::array<std::optional<std::int32_t>, kAxisCount> at;  // from the vectors last read or reported
  std::map<std::uint16_t, std::array<std::optional<std::int32_t>, kAxisCount>> began_at;
};

using BusNode = std::pair<std::string, std::uint8_t>;  // interface, node

struct BusStory {
  std::map<BusNode, OverheardUnit> units;
  std::map<std::string, std::uint64_t> frames;  // by interface
  std::vector<std::string> malformed;  // frames that no decoder accepts, with the rule they broke
};

BusStory Listen(const CandumpLog& log);

}  // namespace focalfleet::test
