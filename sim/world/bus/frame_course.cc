#include "sim/world/bus/frame_course.h"

#include <algorithm>

#include "protocol/base/check.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet::sim {
namespace {

constexpr std::uint32_t kRowMax = 5;  // equal bits that may follow one another

/// The number of equal bits of `recessive` that stand right before bit `end`.
std::uint32_t RowBefore(const FrameLevels& levels, std::uint32_t end, bool recessive) {
  std::uint32_t row = 0;
  while (row < kRowMax && row < end && levels.recessive[end - 1 - row] == recessive) ++row;
  return row;
}

std::uint32_t WithErrorFrame(std::uint32_t bits, std::uint32_t flags) {
  return bits + flags + kDelimiterBits + kIntermissionBits;
}

/// The number of bits before the acknowledgement slot; the CRC delimiter is the last of them.
std::uint32_t SlotOf(const CanFrame& frame) { return ExposedBits(frame) - kEndOfFrameBits - 2; }

}  // namespace

FrameCourse WellSent(const CanFrame& frame) { return {.bits = FrameBits(frame)}; }

std::uint32_t ExposedBits(const CanFrame& frame) { return FrameBits(frame) - kIntermissionBits; }

FrameCourse Unacknowledged(const CanFrame& frame) {
  return {.bits = WithErrorFrame(SlotOf(frame) + 1, kFlagBits),
          .error = FrameError::kAcknowledgement,
          .accepted = false,
          .unanswered = true};
}

FrameCourse RefusedByOne(const CanFrame& frame) {
  // The refusing receiver flags from the last bit of the frame on, all others one bit later.
  return {.bits = WithErrorFrame(ExposedBits(frame) - 1, kFlagBits + 1),
          .error = FrameError::kForm,
          .accepted = true};
}

FrameCourse CutOffAt(const CanFrame& frame, std::uint32_t at) {
  const FrameLevels levels = LevelsOf(frame);
  // In a fixed form the first wrong bit shows the error; here at the latest.
  std::uint32_t seen = at + 1;
  if (at < levels.bits) seen = at + kRowMax + 1 - RowBefore(levels, at, true);
  return {.bits = WithErrorFrame(seen, kFlagBits), .error = FrameError::kStuff, .accepted = false};
}

FrameCourse DisturbedAt(const CanFrame& frame, std::uint32_t at, bool transmitter_passive) {
  FOCALFLEET_CHECK(at < ExposedBits(frame));
  const FrameLevels levels = LevelsOf(frame);
  // Delimiters, slot, end of frame: every node knows the levels of these bits.
  if (at >= levels.bits) {
    const bool slot = at == SlotOf(frame);
    const bool last = at + 1 == ExposedBits(frame);
    return {.bits = WithErrorFrame(at + 1, kFlagBits),
            .error = slot ? FrameError::kAcknowledgement : FrameError::kForm,
            .accepted = last};
  }
  const bool seen_recessive = !levels.recessive[at];
  const std::uint32_t row = RowBefore(levels, at, seen_recessive) + 1;
  if (at < levels.arbitration && !seen_recessive) {
    if (levels.stuff[at])
      return {.bits = WithErrorFrame(at + 1, kFlagBits),
              .error = FrameError::kStuff,
              .accepted = false,
              .excused = true};
    // No node drives the wire any more; six recessive bits later all see it at once.
    return {.bits = WithErrorFrame(at + 1 + kRowMax + 1, kFlagBits),
            .error = FrameError::kStuff,
            .accepted = false,
            .lost_arbitration = true};
  }
  // The transmitter's flag continues the row that receivers see, or begins it. Where the row would
  // outlast the CRC, they see a dominant delimiter, or a wrong CRC, which they signal behind the
  // slot.
  const bool flag_recessive = transmitter_passive;
  const std::uint32_t before = seen_recessive == flag_recessive ? row : 0;
  const std::uint32_t at_latest = levels.bits - at + (flag_recessive ? 2 : 0);
  const std::uint32_t by_row = kRowMax + 1 - before;
  const std::uint32_t unnoticed = row > kRowMax               ? 0
                                  : at + by_row < levels.bits ? by_row
                                                              : at_latest;
  return {.bits = WithErrorFrame(at + 1, unnoticed + kFlagBits),
          .error = FrameError::kBit,
          .accepted = false};
}

}  // namespace focalfleet::sim
