// What somebody learns who only listens to the buses: which hardware answers where, which move each
// unit was given, segment by segment, whether it confirmed and armed it, when it was started and
// where it says it ended. Decoded with protocol/ alone; nothing comes from the coordinator.
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

  /// How far each axis is sent. Units: vectors.
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
  std::vector<std::string> malformed;  // frames that no decoder takes, with the rule they broke
};

BusStory Listen(const CandumpLog& log);

}  // namespace focalfleet::test
