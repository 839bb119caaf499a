// Frames of the plate: the bytes that a page gets. A stream begins with a snapshot; deltas follow,
// each of which goes onto the frame before it. A frame without changes says that the daemon lives.
//
// All numbers are little-endian.
//
//   bytes  field
//   4      length of what follows
//   1      kind: 1 snapshot, 2 delta
//   1      version of this format: 1
//   2      0
//   4      number of the frame; a delta goes onto the frame with the number before
//   8      time at which it was made, ms since 1970 (f64)
//   8      time of the newest status, the same; 0: none yet
//   4      units of the plate
//   4      bytes of facts; 0: as before
//   4      units that come whole
//   4      units of which the angles alone come
//   -      facts: JSON
//   -      for either group that is not empty: a bit for each unit (8 units a byte, the lowest bit
//          first), then 14 or 4 bytes for each unit that has its bit: the members of PlateUnit in
//          their order, or theta and phi. A group of all units has no bits.
//
// A moving unit costs 4 bytes and a bit: 5000 at 10 Hz 206 kB/s, 20,000 825 kB/s.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/page/plate_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

enum class PlateFrameKind : std::uint8_t { kSnapshot = 1, kDelta = 2 };

/// The content of a frame beside the units.
struct PlateFrameHead {
  PlateFrameKind kind = PlateFrameKind::kSnapshot;
  std::uint32_t number = 0;
  WallTime made;
  WallTime status;
  std::string facts;  // empty: as before
};

std::string EncodeSnapshot(const PlateFrameHead& head, std::span<const PlateUnit> units);
/// Pre: equal shapes.
std::string EncodeDelta(const PlateFrameHead& head, std::span<const PlateUnit> before,
                        std::span<const PlateUnit> units);

/// A frame as a page reads it. `units` holds those before the frame, and those after it. Errors:
/// kInvalid: the bytes are no frame, or one that does not go onto these units.
Result<PlateFrameHead> DecodeFrame(std::string_view bytes, std::vector<PlateUnit>* units);

/// Makes the frames of a table, one after the other.
class PlateEncoder {
 public:
  struct Options {
    std::int64_t facts_period_ns = 1'000'000'000;
    std::int64_t heartbeat_period_ns = 1'000'000'000;
  };
  explicit PlateEncoder(std::size_t units, Options options);
  explicit PlateEncoder(std::size_t units) : PlateEncoder(units, Options()) {}

  /// The delta since the last frame; empty where nothing changed and no sign of life is due.
  std::string Next(const PlateTable& table, WallTime now);
  /// The state of the last frame as a snapshot of the same number: the next delta goes onto it.
  [[nodiscard]] std::string Snapshot(WallTime now) const;
  [[nodiscard]] std::uint32_t number() const { return number_; }

 private:
  Options options_;
  std::vector<PlateUnit> sent_;
  std::string facts_;
  std::uint64_t urgent_ = 0;
  std::uint32_t number_ = 0;
  WallTime status_;
  WallTime facts_at_;
  WallTime last_at_;
};

}  // namespace focalfleet
