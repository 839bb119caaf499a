// The position of a motor's field while it runs its segments, in closed form. A segment shows its
// vectors one by one, each for repeat * counter1 counts of the 144 MHz timer. The first vector is
// shown at once when the segment begins; a segment waits for the one before it. All times are by
// the unit's own clock, which runs fast or slow by a share.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/base/limits.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

inline constexpr double kTimerCountsPerNs = 0.144;

/// A unit's clock against the host's: `rate` of its nanoseconds pass in one of the host's.
struct UnitClock {
  double rate = 1;
  [[nodiscard]] DurationNs ToHost(double unit_ns) const;  // rounded up: not before it is due
  [[nodiscard]] double ToUnitNs(DurationNs host) const;
};

class FieldPath {
 public:
  /// The field stands at `position` for ever.
  explicit FieldPath(std::int32_t position = 0) : from_(position), to_(position) {}

  struct Run {
    std::int32_t from = 0;  // vectors
    HostInstant begin;
    UnitClock clock;
    std::uint16_t counter1 = 500;
  };
  FieldPath(const Run& run, std::span<const Segment> segments);

  /// The vector applied at `at`.
  [[nodiscard]] std::int32_t Applied(HostInstant at) const;
  [[nodiscard]] std::int32_t to() const { return to_; }
  /// The instant at which the last vector has been shown for its time; the beginning where there is
  /// none.
  [[nodiscard]] HostInstant end() const { return end_; }

  struct Piece {
    double begin_ns = 0;  // unit's clock, since the start
    double ns_per_vector = 0;
    std::int32_t from = 0;
    std::int32_t delta = 0;
    [[nodiscard]] double end_ns() const;
  };
  [[nodiscard]] std::span<const Piece> pieces() const { return {pieces_.data(), count_}; }
  /// The time by the unit's clock since the start; negative before it.
  [[nodiscard]] double UnitNs(HostInstant at) const { return clock_.ToUnitNs(at - begin_); }

 private:
  std::int32_t from_ = 0;
  std::int32_t to_ = 0;
  HostInstant begin_;
  HostInstant end_;
  UnitClock clock_;
  std::array<Piece, limits::kSegmentsPerAxis> pieces_{};
  std::size_t count_ = 0;
};

}  // namespace focalfleet::sim
