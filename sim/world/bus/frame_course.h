// The course of one attempt to send a frame, in bits. No other file says how long frames and error
// frames hold the wire (ISO 11898-1; Bosch CAN 2.0 part B, sections 3 and 6):
//
//   good        the frame, its intermission included (protocol/wire/frame_bits.h)
//   destroyed   the frame up to the bit in which a node sees the error, the superposed error
//               flags 6..12, error delimiter 8, intermission 3
//
// All nodes see a disturbed bit wrongly. The transmitter notices at once that the wire is not as it
// drives it, and flags from the next bit on. The receivers notice a sixth equal bit; the flag
// completes that row, whichever level it has. Where the form is fixed they notice at once. They
// then add six bits of their own, so the flags take 6 to 12. (Receivers know where the CRC ends
// from the frame as it was sent. A real receiver that unstuffs a disturbed bit may be a bit off
// there.)
#pragma once

#include <cstdint>

#include "protocol/wire/can_frame.h"

namespace focalfleet::sim {

inline constexpr std::uint32_t kFlagBits = 6;
inline constexpr std::uint32_t kDelimiterBits = 8;
inline constexpr std::uint32_t kEndOfFrameBits = 7;
inline constexpr std::uint32_t kIntermissionBits = 3;
inline constexpr std::uint32_t kSuspendBits = 8;  // behind a frame of an error-passive transmitter
/// A row of eleven recessive bits; 128 rows bring a controller back from bus-off. The end of every
/// frame, good or destroyed, is a row.
inline constexpr std::uint32_t kRecessiveRowBits = 11;
inline constexpr std::uint32_t kRecessiveRows = 128;

enum class FrameError : std::uint8_t { kNone, kAcknowledgement, kBit, kStuff, kForm };
inline constexpr std::size_t kFrameErrorCount = 5;
constexpr const char* Name(FrameError error) {
  constexpr const char* kNames[] = {"none", "no acknowledgement", "bit error", "stuff error",
                                    "form error"};
  return kNames[static_cast<std::size_t>(error)];
}

struct FrameCourse {
  std::uint32_t bits = 0;                // until the next frame may begin
  FrameError error = FrameError::kNone;  // as the transmitter sees it
  bool accepted = true;                  // by the receivers
  /// The transmitter took the disturbance for a lost arbitration, and counts as a receiver.
  bool lost_arbitration = false;
  /// A stuff bit in arbitration: the transmitter does not count the error (exception 2 of rule 3).
  bool excused = false;
  /// No other node flags: a passive transmitter does not count the error (exception 1 of rule 3).
  bool unanswered = false;
};

FrameCourse WellSent(const CanFrame& frame);

/// The bits of a frame that a disturbance can hit: from start to end of frame, without
/// intermission.
std::uint32_t ExposedBits(const CanFrame& frame);

/// All nodes see bit `at`, from 0, inverted. Pre: at < ExposedBits(frame). Receivers no longer look
/// at the last bit: they have the frame, and get it again.
FrameCourse DisturbedAt(const CanFrame& frame, std::uint32_t at, bool transmitter_passive);

/// No node drives the acknowledgement slot; the flag begins behind it.
FrameCourse Unacknowledged(const CanFrame& frame);

/// A single receiver sees the last but one bit of the end of frame wrongly and flags into the last
/// one. All others have the frame, and the transmitter must send it again.
FrameCourse RefusedByOne(const CanFrame& frame);

/// The transmitter is cut off (power, plug) in bit `at`: the others see recessive bits from there.
FrameCourse CutOffAt(const CanFrame& frame, std::uint32_t at);

}  // namespace focalfleet::sim
